"""Domains of OpenSees, printed as JSON and read back: its own eigenvalues are the truth."""

import json

import numpy as np
import pytest

from femupdate.building import load_building, mesh_building
from femupdate.building.model_files import write_draft
from femupdate.errors import BuildingError
from femupdate.fe import assemble, lowest_modes

ops = pytest.importorskip("openseespy.opensees")

E, G = 3e10, 1.25e10


def columns_and_beams(plan, levels, beam, column, present=lambda x, y, k: True):
    """Nodes on a plan at all levels, joined; returns the nodes of every level."""
    floors = []
    for k, z in enumerate(levels):
        floors.append({})
        for n, (x, y) in enumerate(plan):
            if present(x, y, k):
                floors[k][x, y] = 100 * k + n + 1
                ops.node(floors[k][x, y], float(x), float(y), float(z))
    for k in range(1, len(levels)):
        for place, node in floors[k].items():
            column(floors[k - 1][place], node)
        for (x, y), node in floors[k].items():
            for other in ((x + 5, y), (x, y + 4)):
                if other in floors[k]:
                    beam(node, floors[k][other])
    for node in floors[0].values():
        ops.fix(node, *FIXED)
    return floors


FIXED = (1, 1, 1, 1, 1, 1)
PLAN = [(x, y) for x in (0, 5, 10) for y in (0, 4)]
TAGS = iter(range(1, 100_000))


def elastic(transformation, area, inner, outer, *more):
    figures = (area, E, G, 1.2 * inner, inner, outer, transformation, *more)
    return lambda a, b: ops.element("elasticBeamColumn", next(TAGS), a, b, *figures)


def plain_frame():
    ops.geomTransf("Linear", 1, 0.0, 1.0, 0.0)
    ops.geomTransf("PDelta", 2, 0.0, 0.0, 1.0)
    beam = elastic(2, 0.15, 0.003, 0.001, "-mass", 900.0, "-cMass")
    column = elastic(1, 0.16, 0.0021, 0.0027, "-mass", 400.0, "-cMass")
    floors = columns_and_beams(PLAN, (0.0, 3.5, 6.5, 9.5), beam, column)
    for floor in floors[1:]:
        for node in floor.values():
            ops.mass(node, 8e3, 8e3, 8e3, 0.0, 0.0, 0.0)
    return 'diaphragms = "none"\nmass = "consistent"', "fixed"


def wall_of_shells():
    ops.section("ElasticMembranePlateSection", 1, E, 0.2, 0.25, 2500.0)
    for j in range(61):
        for i in range(25):
            ops.node(100 * j + i + 1, 0.2 * i, 0.0, 0.15 * j)
            if not j:
                ops.fix(i + 1, *FIXED)
            elif not j % 20:
                ops.mass(100 * j + i + 1, 1e3, 1e3, 1e3, 0.0, 0.0, 0.0)
    for j in range(60):
        for i in range(24):
            n = 100 * j + i + 1
            ops.element("ShellMITC4", next(TAGS), n, n + 1, n + 101, n + 100, 1)
    ops.section("Elastic", 2, E, 0.16, 0.002, 0.002, G, 0.003)
    ops.geomTransf("Linear", 1, 0.0, 0.0, 1.0)
    for j in (20, 40, 60):  # which says where floors are
        for i in range(24):
            n = 100 * j + i + 1
            figures = (1e-3, E, G, 1e-6, 1e-6, 1e-6, 1)
            ops.element("elasticBeamColumn", next(TAGS), n, n + 1, *figures)
    return 'diaphragms = "none"\nmass = "lumped"', "fixed"


def rigid_floors():
    ops.geomTransf("Linear", 1, 0.0, 1.0, 0.0)
    ops.geomTransf("Linear", 2, 0.0, 0.0, 1.0)
    floors = columns_and_beams(
        PLAN,
        (0.0, 3.5, 6.5, 9.5, 12.5),
        elastic(2, 0.15, 0.003, 0.001),
        elastic(1, 0.16, 0.0021, 0.0027),
    )
    for k, floor in enumerate(floors[1:], 1):
        ops.node(900 + k, 5.5, 1.8, 0.5 + 3.0 * k)
        ops.fix(900 + k, 0, 0, 1, 1, 1, 0)
        ops.mass(900 + k, 6e4, 6e4, 0.0, 0.0, 0.0, 9e5)
        ops.rigidDiaphragm(3, 900 + k, *floor.values())
    return 'diaphragms = "*"', "fixed"


def braces_and_offsets():
    ops.geomTransf("Linear", 1, 0.0, 1.0, 0.0)
    ops.geomTransf("Linear", 2, 0.0, 0.0, 1.0, "-jntOffset", 0.0, 0.0, -0.3, 0.0, 0.0, -0.3)
    ops.uniaxialMaterial("Elastic", 1, 2.1e11)

    def column(a, b):
        figures = (E, G, 0.16, 0.003, 0.0021, 0.0027, 0.13, 0.12, 1, "-mass", 400.0)
        ops.element("ElasticTimoshenkoBeam", next(TAGS), a, b, *figures)

    beam = elastic(2, 0.15, 0.003, 0.001, "-mass", 3000.0, "-releasey", 2)
    columns_and_beams(PLAN, (0.0, 3.5, 6.5), beam, column)
    for k in range(2):
        ops.element("Truss", next(TAGS), 100 * k + 1, 100 * k + 103, 2e-3, 1)
    for node in range(1, 7):
        ops.mass(200 + node, 5e3, 5e3, 5e3, 100.0, 200.0, 300.0)
    return 'diaphragms = "none"\nmass = "lumped"', "fixed"


def irregular():
    """An L in plan with a setback, a slab of shells on one floor, in kN and m."""
    ops.geomTransf("Linear", 1, 0.0, 1.0, 0.0)
    ops.geomTransf("Corotational", 2, 0.0, 0.0, 1.0)
    ops.section("Elastic", 1, E / 1e3, 0.16, 0.0027, 0.0021, G / 1e3, 0.003)
    ops.beamIntegration("Lobatto", 1, 1, 5)

    def column(a, b):
        ops.element("forceBeamColumn", next(TAGS), a, b, 1, 1)

    def beam(a, b):
        figures = (0.15, E / 1e3, G / 1e3, 0.0036, 0.003, 0.001, 2)
        ops.element("elasticBeamColumn", next(TAGS), a, b, *figures)

    plan = [(x, y) for x in (0, 5, 10) for y in (0, 4, 8)]
    floors = columns_and_beams(
        plan,
        (0.0, 4.0, 7.0, 10.0),
        beam,
        column,
        lambda x, y, k: (x < 10 or y < 8) and (k < 3 or x < 10),
    )
    for k, floor in enumerate(floors[1:], 1):
        for node in floor.values():
            ops.mass(node, 9.0 + k, 9.0 + k, 9.0 + k, 0.0, 0.0, 0.0)
        if k != 2:
            ops.rigidDiaphragm(3, *sorted(floor.values(), key=lambda n: n % 100))
    return 'diaphragms = ["2F", "RF"]', "fixed"


def hinged_sections():
    """Moment and curvature at ends, elastic middles, as in frames of old concrete."""
    for tag, rate in ((1, 5e9), (2, 0.7 * E * 0.0021), (3, 0.6 * E * 0.0027), (4, 0.5 * G * 0.003)):
        yielding = (rate * 0.002, 0.002, rate * 0.003, 0.02, rate * 0.0031, 0.05)
        ops.uniaxialMaterial("Hysteretic", tag, *yielding, *(-v for v in yielding), 1, 1, 0, 0, 0)
    ops.section("Aggregator", 1, 1, "P", 2, "My", 3, "Mz", 4, "T")
    ops.section("Elastic", 2, E, 0.16, 0.0027, 0.0021, G, 0.003)
    ops.uniaxialMaterial("Elastic", 10, 0.8 * G * 0.16)
    ops.section("Aggregator", 3, 4, "T", 10, "Vy", 10, "Vz", "-section", 2)
    for tag in (4, 6):  # ends that only bend, each by its own number
        ops.section("Uniaxial", tag, 2, "Mz")
        ops.section("Aggregator", tag + 1, 3, "My", "-section", tag)
    # OpenSees has no JSON for it; nothing uses it.
    envelope = (1e5, 0.001, 2e5, 0.01, 2.5e5, 0.02, 1e4, 0.1)
    ops.uniaxialMaterial("Pinching4", 9, *envelope, 0.5, 0.5, 0.1, *[0.0] * 15, 1.0, "energy")


def infilled_frame():
    """Beams and columns with hinges, struts in two bays of every story."""
    hinged_sections()
    ops.geomTransf("PDelta", 1, 0.0, 1.0, 0.0, "-jntOffset", 0.0, 0.0, 0.25, 0.0, 0.0, -0.25)
    ops.geomTransf("Linear", 2, 0.0, 0.0, 1.0)
    ops.beamIntegration("HingeRadau", 1, 1, 0.25, 1, 0.25, 2)
    ops.beamIntegration("HingeMidpoint", 2, 3, 0.3, 3, 0.3, 2)
    column = lambda a, b: ops.element("forceBeamColumn", next(TAGS), a, b, 1, 1)  # noqa: E731
    beam = lambda a, b: ops.element("forceBeamColumn", next(TAGS), a, b, 2, 2)  # noqa: E731
    columns_and_beams(PLAN, (0.0, 3.2, 6.2, 9.2), beam, column)
    ops.uniaxialMaterial("Concrete01", 5, -2e6, -0.001, -1e6, -0.003)
    ops.uniaxialMaterial("MinMax", 6, 5, "-min", -0.01, "-max", 0.01)
    for k in range(3):
        for a, b in ((1, 103), (3, 101), (2, 104)):
            ops.element("Truss", next(TAGS), 100 * k + a, 100 * k + b, 0.12, 6)
    for node in [100 * k + n for k in (1, 2, 3) for n in range(1, 7)]:
        ops.mass(node, 8e3, 8e3, 8e3, 0.0, 0.0, 0.0)
    return 'diaphragms = "none"\nmass = "lumped"\nelastic = "*"', "fixed"


def infilled_joints():
    """An open ground story, joints that turn, struts of links, rigid floors."""
    hinged_sections()
    ops.geomTransf("Linear", 1, 0.0, 1.0, 0.0)
    ops.geomTransf("Linear", 2, 0.0, 0.0, 1.0)
    ops.beamIntegration("HingeEndpoint", 1, 5, 0.25, 7, 0.25, 2)
    column = lambda a, b: ops.element("forceBeamColumn", next(TAGS), a, b, 1, 1)  # noqa: E731
    joints = {}

    def joint(node):
        if node not in joints:
            joints[node] = node + 50
            ops.node(node + 50, *ops.nodeCoord(node))
            stiff, soft = 11, 12
            directions = ("-mat", stiff, stiff, stiff, stiff, soft, soft, "-dir", 1, 2, 3, 6, 4, 5)
            ops.element("zeroLength", next(TAGS), node, node + 50, *directions)
        return joints[node]

    ops.uniaxialMaterial("Elastic", 11, 1e11)
    yielding = (1e5, 1e-3, 1.5e5, 1e-2, 1.6e5, 5e-2)
    ops.uniaxialMaterial("Hysteretic", 12, *yielding, *(-v for v in yielding), 1, 1, 0, 0, 0)
    figures = (0.15, E, G, 0.003, 0.003, 0.001, 2)

    def beam(a, b):
        ops.element("elasticBeamColumn", next(TAGS), joint(a), joint(b), *figures)

    floors = columns_and_beams(PLAN, (0.0, 3.2, 6.2, 9.2), beam, column)
    ops.uniaxialMaterial("ElasticPP", 13, 4e7, 0.002)
    ops.uniaxialMaterial("Elastic", 14, 1e7)
    ops.uniaxialMaterial("Parallel", 15, 13, 14)
    for k in (1, 2):
        for a, b in ((1, 103), (2, 104), (4, 106)):
            link = (100 * k + a, 100 * k + b, "-mat", 15, "-dir", 1)
            ops.element("twoNodeLink", next(TAGS), *link)
    for floor in floors[1:]:
        for node in floor.values():
            ops.mass(node, 9e3, 9e3, 9e3, 0.0, 0.0, 0.0)
    return 'diaphragms = "none"\nelastic = "*"', "fixed"


DOMAINS = (
    *(plain_frame, wall_of_shells, rigid_floors, braces_and_offsets, irregular),
    *(infilled_frame, infilled_joints),
)


def printed(domain, folder):
    """File of a domain, what is to be said beside it, and its frequencies."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    said, base = domain()
    path = folder / "model.json"
    ops.printModel("-JSON", "-file", str(path))
    ops.constraints("Transformation")
    values = np.array(ops.eigen("-genBandArpack", 6))
    ops.wipe()
    return path, said, base, np.sqrt(values) / (2.0 * np.pi)


def completed(path, said, base, units):
    """A draft with what the user must say."""
    draft = write_draft(path, units, path.with_suffix(".toml"))
    lines = [line for line in draft.read_text().splitlines() if "# diaphragms" not in line]
    text = "\n".join(line for line in lines if "# mass =" not in line)
    text = text.replace("# [supports]\n# base", "[supports]\nbase")
    draft.write_text(text.replace("# ignore", f"{said}\n# ignore"))
    return load_building(draft)


@pytest.mark.parametrize("domain", DOMAINS, ids=lambda domain: domain.__name__)
def test_a_domain_has_its_own_frequencies(domain, tmp_path):
    path, said, base, expected = printed(domain, tmp_path)
    units = "kN,m" if domain is irregular else "N,m"
    building = completed(path, said, base, units)
    mesh = mesh_building(building)
    found = lowest_modes(assemble(mesh.model), np.ones(mesh.model.groups), 6).frequency_hz
    # Plates that twist differ by .2 %, by a quarter of it where sides are halved.
    twisting = [1, 3, 4, 5] if domain is wall_of_shells else []
    np.testing.assert_allclose(found[twisting], expected[twisting], rtol=2.5e-3)
    rest = np.delete(np.arange(6), twisting)
    np.testing.assert_allclose(found[rest], expected[rest], rtol=1e-3)
    told = " ".join(mesh.notes)
    assert "Floors: 2F 3" in told or "Floors: 2F 4" in told
    assert ("Factors hold for a fine mesh" in told) == bool(len(mesh.model.faces))
    assert "node" in told
    assert "BeamColumn3d" in told or "ElasticBeam3d" in told
    assert ("Nothing holds floors in their plane" in told) == ('"none"' in said)


def test_what_is_not_printed_is_asked_for(tmp_path):
    path, *_ = printed(rigid_floors, tmp_path)
    with pytest.raises(
        BuildingError, match=r"mesh.diaphragms, supports.base: these keys are missing"
    ):
        load_building(path, "N,m")
    asked = r"by --units, .*--draft then asks for .*rigid in plan, what holds"
    with pytest.raises(BuildingError, match=asked):
        load_building(path)
    json.loads(path.read_text())
