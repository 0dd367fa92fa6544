"""A second opinion: a Python script that rebuilds a model in OpenSeesPy and prints its frequencies.

The script stands alone and holds the model as tables of text. It needs `openseespy`, whose licence
restricts commercial redistribution; femupdate itself never imports it.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np

from femupdate import __version__
from femupdate.arrays import Floats, Integers
from femupdate.errors import ModelError
from femupdate.fe.check import check_model
from femupdate.fe.model import (
    DOF_NAMES,
    Beams,
    FiniteElementModel,
    RigidLinks,
    Shells,
    Springs,
    Triangles,
)

ShellName = Literal["ASDShellQ4", "ShellMITC4", "ShellDKGQ"]
SHELL_NAMES: tuple[ShellName, ...] = ("ASDShellQ4", "ShellMITC4", "ShellDKGQ")
_RIGID = (True, True, True, True, True, True)
_DIAPHRAGM = (True, True, False, False, False, True)


def opensees_script(
    model: FiniteElementModel,
    theta: Floats,
    *,
    name: str = "model",
    modes: int = 12,
    shell: ShellName = "ASDShellQ4",
) -> str:
    """Return the script.

    Shells become ASDShellQ4 or another four-node shell (three-node ones ASDShellT3), beams
    ElasticTimoshenkoBeam with consistent mass (elasticBeamColumn where they do not shear), point
    masses nodal masses, springs zeroLength elements, rigid links rigidLink and rigidDiaphragm. The
    stiffness factors are in the moduli.

    Args:
        model: what to rebuild.
        theta: (p,) stiffness parameters.
        name: of the building, for the heading.
        modes: how many to ask for by default.
        shell: the four-node shell to use.

    Raises:
        ModelError: the model holds what OpenSees has no counterpart for (released beam ends, a
            link of another kind), or theta has another length.
    """
    check_model(model)
    factors = np.asarray(theta, dtype=float)
    if factors.shape != (model.groups,) or shell not in SHELL_NAMES:
        raise ModelError(
            f"the export needs {model.groups} stiffness parameters and one of "
            f"{', '.join(SHELL_NAMES)} as shell; got {factors.size} and {shell}"
        )
    _refuse_releases(model.beams)
    tables = {
        "NODES": (("x", "y", "z"), _columns(model.nodes)),
        "SUPPORTS": (("node", *DOF_NAMES), _supports(model)),
        "MASSES": (("node", "kg", "kg m2 about x", "y", "z"), _masses(model)),
        **_shell_tables("SHELL", model.shells, factors),
        **_shell_tables("TRIANGLE", model.triangles, factors),
        **_beam_tables(model.beams, factors),
        "SPRINGS": (
            ("node", "node or -1", "direction", "N/m or N m/rad"),
            _springs(model, factors),
        ),
        "RIGID": (("master", "slave"), _links(model, _RIGID)),
        "DIAPHRAGM": (("master", "slave"), _links(model, _DIAPHRAGM)),
    }
    head = _HEAD.format(
        name=name, version=__version__, shell=shell, modes=modes, theta=_numbers(factors)
    )
    return head + "".join(_table(key, *table) for key, table in tables.items()) + _BODY


def _numbers(values: Iterable[Any]) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _table(name: str, head: Sequence[str], rows: Iterable[str]) -> str:
    lines = "\n".join(rows)
    return f'# {", ".join(head)}\n{name} = table("""\n{lines}\n""")\n\n'


def _columns(*columns: Any) -> list[str]:
    """Rows of text from columns (n,) or (n, k)."""
    return [
        _numbers(np.concatenate([np.ravel(v) for v in row])) for row in zip(*columns, strict=True)
    ]


def _supports(model: FiniteElementModel) -> list[str]:
    held = np.flatnonzero(model.fixed.any(axis=1))
    return _columns(held, model.fixed[held].astype(int))


def _masses(model: FiniteElementModel) -> list[str]:
    """One row a node, for OpenSees keeps the last mass of a node and forgets the others."""
    masses = model.masses
    nodes, where = np.unique(masses.node, return_inverse=True)
    values = np.zeros((len(nodes), 4))
    np.add.at(values, where, np.column_stack([masses.mass, masses.inertia]))
    return _columns(nodes, values)


def _factored(
    elements: Shells | Triangles | Beams | Springs, stiffness: Floats, factors: Floats
) -> Floats:
    """Moduli or stiffnesses with the factor of each group in them."""
    return stiffness * np.where(elements.group >= 0, np.append(factors, 1.0)[elements.group], 1.0)


def _shell_tables(
    name: str, shells: Shells | Triangles, factors: Floats
) -> dict[str, tuple[tuple[str, ...], list[str]]]:
    youngs_modulus = _factored(shells, shells.youngs_modulus, factors)
    kinds, which = np.unique(
        np.column_stack([youngs_modulus, shells.poisson_ratio, shells.thickness, shells.density]),
        axis=0,
        return_inverse=True,
    )
    corners = tuple("node" for _ in range(shells.nodes.shape[1]))
    return {
        f"{name}_SECTIONS": (("E in Pa", "nu", "thickness in m", "kg/m3"), _columns(kinds)),
        f"{name}S": ((*corners, "section"), _columns(shells.nodes, which.ravel())),
    }


def _beam_tables(beams: Beams, factors: Floats) -> dict[str, tuple[tuple[str, ...], list[str]]]:
    youngs_modulus = _factored(beams, beams.youngs_modulus, factors)
    kinds, which = np.unique(
        np.column_stack(
            [
                youngs_modulus,
                youngs_modulus / (2.0 * (1.0 + beams.poisson_ratio)),
                beams.area,
                beams.torsion_constant,
                beams.inertia_y,
                beams.inertia_z,
                beams.shear_area_y,
                beams.shear_area_z,
                beams.density * beams.area,
            ]
        ),
        axis=0,
        return_inverse=True,
    )
    arms = np.zeros((len(beams), 6)) if beams.offset is None else beams.offset.reshape(-1, 6)
    head = ("E", "G", "A", "J", "Iy", "Iz", "shear area y", "shear area z", "kg/m")
    return {
        "BEAM_SECTIONS": (head, _columns(kinds)),
        "BEAMS": (
            (
                "node",
                "node",
                "section",
                "up x",
                "y",
                "z",
                "rigid arms: first x",
                "y",
                "z",
                "second",
            ),
            _columns(beams.nodes, which.ravel(), beams.up, arms),
        ),
    }


def _springs(model: FiniteElementModel, factors: Floats) -> list[str]:
    springs = model.springs
    stiffness = _factored(springs, springs.stiffness, factors)
    return _columns(springs.nodes, springs.direction, stiffness)


def _refuse_releases(beams: Beams) -> None:
    if beams.released is not None and beams.released.any():
        first = int(beams.released.any(axis=1).argmax())
        raise ModelError(
            f"beam {first} has a released end, which the OpenSees script cannot hold; export the "
            "building without hinged members"
        )


def _links(model: FiniteElementModel, tied: tuple[bool, ...]) -> list[str]:
    """Links of one kind, each to the last master of its chain."""
    links = model.links
    own = (links.tied == np.array(tied)).all(axis=1)
    known = (links.tied == np.array(_RIGID)).all(axis=1) | (
        (links.tied == np.array(_DIAPHRAGM)).all(axis=1)
    )
    if not known.all():
        first = int((~known).argmax())
        raise ModelError(
            f"the rigid link from node {links.master[first]} to node {links.slave[first]} ties "
            "neither all six motions nor those of a floor in its plane; OpenSees has no such link"
        )
    return _columns(_last_masters(links)[own], links.slave[own])


def _last_masters(links: RigidLinks) -> Integers:
    """The node at the end of each chain: OpenSees does not follow chains of links."""
    rigid = links.tied.all(axis=1)
    follows = dict(zip(links.slave[rigid].tolist(), links.master[rigid].tolist(), strict=True))
    found = links.master.copy()
    for k, master in enumerate(found.tolist()):
        while master in follows:
            master = follows[master]
        found[k] = master
    return found


_HEAD = '''#!/usr/bin/env python3
"""{name} in OpenSeesPy: builds the model, runs its modal analysis and prints the frequencies.

Written by femupdate {version}. Install OpenSees with `pip install openseespy`, then run
    python THIS_FILE [--modes {modes}] [--shell {shell}] [--solver SparseGeneral]
SI units throughout: m, N, kg, s. Stiffness factors in the moduli: {theta}
"""

import argparse
import json
import time

import numpy as np
import openseespy.opensees as ops

MODES = {modes}
SHELL = "{shell}"  # or ShellMITC4, ShellDKGQ


def table(text):
    return [[float(word) for word in line.split()] for line in text.strip().splitlines()]


'''

_BODY = '''MASTERS = {int(slave) + 1: int(master) + 1 for master, slave in RIGID}


def whole(values):
    """Node numbers as OpenSees wants them, counted from 1."""
    return [int(value) + 1 for value in values]


def build(shell):
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for number, point in enumerate(NODES, start=1):
        ops.node(number, *point)
    for node, *held in SUPPORTS:
        ops.fix(int(node) + 1, *[int(flag) for flag in held])
    for node, mass, *inertia in MASSES:
        ops.mass(int(node) + 1, mass, mass, mass, *inertia)
    element = section = 0
    for kind, sections, shells in (
        (shell, SHELL_SECTIONS, SHELLS),
        ("ASDShellT3", TRIANGLE_SECTIONS, TRIANGLES),
    ):
        for number, properties in enumerate(sections, start=section + 1):
            ops.section("ElasticMembranePlateSection", number, *properties)
        for *corners, which in shells:
            element += 1
            ops.element(kind, element, *whole(corners), section + 1 + int(which))
        section += len(sections)
    for row in BEAMS:
        element += 1
        beam(element, row)
    for number, row in enumerate(SPRINGS, start=1):
        spring(element + number, len(NODES) + number, row)
    for master, slave in RIGID:
        ops.rigidLink("beam", *whole((master, slave)))
    for master, slave in DIAPHRAGM:
        ops.rigidDiaphragm(3, *whole((master, slave)))


def beam(tag, row):
    ends, which, up = whole(row[:2]), int(row[2]), row[3:6]
    ends = [arm(end, row[6 + 3 * k : 9 + 3 * k], 2 * tag + k) for k, end in enumerate(ends)]
    E, G, A, J, Iy, Iz, shear_y, shear_z, line_mass = BEAM_SECTIONS[which]
    ops.geomTransf("Linear", tag, *up)
    mass = ("-mass", line_mass, "-cMass")
    if np.isinf(shear_y) or np.isinf(shear_z):
        ops.element("elasticBeamColumn", tag, *ends, A, E, G, J, Iy, Iz, tag, *mass)
    else:
        properties = (E, G, A, J, Iy, Iz, shear_y, shear_z)
        ops.element("ElasticTimoshenkoBeam", tag, *ends, *properties, tag, *mass)


def arm(node, offset, tag):
    """The node at the end of a rigid arm; ElasticTimoshenkoBeam does not know -jntOffset."""
    if not any(offset):
        return node
    end = len(NODES) + len(SPRINGS) + tag
    ops.node(end, *(np.array(NODES[node - 1]) + offset).tolist())
    ops.rigidLink("beam", MASTERS.get(node, node), end)
    return end


def spring(tag, ground, row):
    first, second, direction = int(row[0]) + 1, int(row[1]) + 1, int(row[2]) + 1
    if second == 0:  # a spring to the ground: a held node in the same place
        second = ground
        ops.node(second, *NODES[first - 1])
        ops.fix(second, 1, 1, 1, 1, 1, 1)
    ops.uniaxialMaterial("Elastic", tag, row[3])
    ops.element("zeroLength", tag, second, first, "-mat", tag, "-dir", direction)


def frequencies(count, solver):
    arms = any(any(row[6:]) for row in BEAMS)
    ops.constraints("Transformation" if RIGID or DIAPHRAGM or arms else "Plain")
    ops.numberer("RCM")
    ops.system(solver)
    ops.test("NormUnbalance", 1e-8, 1)
    ops.algorithm("Linear")
    ops.integrator("LoadControl", 0.0)
    ops.analysis("Static", "-noWarnings")
    return (np.sqrt(np.maximum(ops.eigen(count), 0.0)) / (2 * np.pi)).tolist()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--modes", type=int, default=MODES)
    parser.add_argument("--shell", default=SHELL)
    parser.add_argument("--solver", default="SparseGeneral", help="or UmfPack, ProfileSPD")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    wall, cpu = time.perf_counter(), time.process_time()
    build(options.shell)
    found = frequencies(options.modes, options.solver)
    report = {
        "frequencies_hz": found,
        "seconds": time.perf_counter() - wall,
        "cpu_seconds": time.process_time() - cpu,
    }
    if options.json:
        print(json.dumps(report))
    else:
        print("\\n".join(f"mode {k:3d}  {value:10.5f} Hz" for k, value in enumerate(found, 1)))
        print(f"{report['seconds']:.2f} s, building the model included")
'''
