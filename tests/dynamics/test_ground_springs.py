"""Springs and dashpots to the ground: a rigid block by closed form, a frame by OpenSees."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document
from femupdate.dynamics import (
    ConstantDamping,
    ReductionTarget,
    System,
    driven_system,
    history_batches,
    reduce_structure,
    reduced_on,
)
from femupdate.effects import structure_of
from femupdate.fe import opensees_script
from tests.documents import concrete, frame, rectangle

GRID = np.linspace(0.2, 12.0, 60)
ISOLATORS = {"kx": 8e5, "ky": 9e5, "kz": 4e8, "cx": 3e4, "cy": 2e4, "cz": 5e4}


def document(**changes):
    """Two stories, 6 m by 5 m, unsymmetrical in x; stub columns of 1 m on springs."""
    made = frame(
        {"A": 0.0, "B": 6.0},
        {"P": 0.0, "Q": 5.0},
        {"low": 1.0, "high": 3.0},
        size=6.0,
        grid=(0.2, 60),
        materials=concrete(30e9, 2500.0),
        sections={"column": rectangle(0.4, 0.5), "beam": rectangle(0.3, 0.5)},
        braces=[{"section": "beam", "along": "P", "from": "A", "to": "B", "stories": "high"}],
        springs=[{"at": ["A-P", "A-Q"], **ISOLATORS}, {"at": ["B-P", "B-Q"], **ISOLATORS}],
        sensors={"direction": "x", "points": ["A-P", "B-Q"]},
    )
    return made | changes


def whole_frf(structure, zeta=0.0, theta=None):
    """FRFs (f, k) on a complete basis."""
    factors = np.ones(len(structure.stiffness_terms)) if theta is None else theta
    stiffness = structure.stiffness(factors).toarray()
    basis = eigh(stiffness, structure.mass.toarray())[1]
    system = System(reduced_on(structure, basis).model)
    known = (torch.from_numpy(np.atleast_2d(v)) for v in (factors, [zeta], np.zeros((1, 0))))
    theta, ratio, sizes = known
    return system.frf(theta, ratio[0], sizes, torch.from_numpy(GRID))[0].numpy()


@pytest.mark.parametrize("way", ["under columns", "one footing"])
def test_a_rigid_block_sways_and_rocks_as_by_hand(way):
    """[m, m h; m h, I] with I about the base; height h and width b of a slab of mass m."""
    mass, width, height = 50e3, 6.0, 3.0
    rigid = document(
        stories=[{"name": "low", "height": height}],
        slabs=[{"x": ["A", "B"], "y": ["P", "Q"], "thickness": 1.0}],
        braces=[],
        beams=[],
    )
    rigid["sections"]["column"] = {"shape": "rectangle", "width": 1.0, "depth": 1.0}
    rigid["materials"]["concrete"] |= {"youngs_modulus": 1e17, "density": mass / 30.0}
    rigid["materials"]["air"] = {"youngs_modulus": 1e17, "poisson_ratio": 0.2, "density": 1.0}
    rigid["sections"]["column"]["material"] = rigid["sections"]["beam"]["material"] = "air"
    rigid["slabs"][0]["material"] = "concrete"
    sway, rock = (4 * 8e5, 4 * 3e4), (4 * 2e7 * 9.0, 4 * 6e5 * 9.0)
    rigid["springs"] = [{"kx": 8e5, "cx": 3e4, "kz": 2e7, "cz": 6e5, "kry": 1.0}]
    if way == "one footing":
        del rigid["springs"]
        whole = {"kx": sway[0], "cx": sway[1], "kry": rock[0], "cry": rock[1]}
        rigid["supports"] = {"base": "springs", **whole}
    inertia = mass * (height**2 + width**2 / 12.0 + 1.0 / 12.0)
    M = np.array([[mass, mass * height], [mass * height, inertia]])
    by_hand = []
    for w in 2.0 * np.pi * GRID:
        K = np.diag([k + 1j * w * c for k, c in (sway, rock)])
        moved = np.linalg.solve(K - w**2 * M, M[:, 0])
        by_hand.append(1.0 + w**2 * (moved[0] + height * moved[1]))
    found = whole_frf(structure_of(from_document(rigid)))[0]
    # The slab's mass is that of nine or more elements in each direction but for 1/n^2 of it.
    np.testing.assert_allclose(found, by_hand, rtol=2e-2)


def test_opensees_has_the_same_matrices_with_its_dashpots(opensees):
    """Its K, C and M by the integrator that gives them; zeroLength with elastic and viscous."""
    structure = structure_of(from_document(document()))
    assert structure.mesh is not None
    script = opensees_script(structure.mesh.model, np.ones(2))
    names = {"__name__": "model"}
    exec(compile(script, "model", "exec"), names)
    names["build"]()
    ops, matrices = opensees, []
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormUnbalance", 1e-8, 1)
    ops.algorithm("Linear")
    for weights in np.eye(3):
        ops.integrator("GimmeMCK", *weights.tolist())
        ops.analysis("Transient", "-noWarnings")
        ops.analyze(1, 0.0)
        flat = np.array(ops.printA("-ret"))
        matrices.append(flat.reshape(2 * [round(len(flat) ** 0.5)]))
    M, C, K = matrices
    place = {}
    for node, axis in itertools.product(ops.getNodeTags(), range(6)):
        number = ops.nodeDOFs(node)[axis]
        if number >= 0:
            place[number] = (ops.nodeCoord(node), axis)
    along = np.array([float(place[n][1] == 0) for n in range(len(K))])
    theirs = np.zeros((2, len(GRID)), dtype=complex)
    for number, w in enumerate(2.0 * np.pi * GRID):
        moved = np.linalg.solve(K + 1j * w * C - w**2 * M, M @ along)
        for floor, level in enumerate((1.0, 4.0)):
            seen = [
                n
                for n, (point, axis) in place.items()
                if axis == 0 and tuple(point) in ((0.0, 0.0, level), (6.0, 5.0, level))
            ]
            assert len(seen) == 2
            theirs[floor, number] = 1.0 + w**2 * moved[seen].mean()
    ops.wipe()
    assert np.abs(C).max() == pytest.approx(5e4)
    # Its beams have no rotary inertia.
    np.testing.assert_allclose(whole_frf(structure), theirs, rtol=5e-3)


@pytest.fixture(scope="module")
def slabbed():
    slab = {"x": ["A", "B"], "y": ["P", "Q"], "thickness": 0.25}
    return structure_of(from_document(document(slabs=[slab], mesh={"size": 1.5})))


TARGET = ReductionTarget(np.full(2, 0.5), np.full(2, 2.0), GRID, 0.01, 0.02, samples=8)


def test_a_certified_basis_holds_what_dashpots_do(slabbed):
    reduction = reduce_structure(slabbed, TARGET)
    assert reduction.rms_error < 0.02
    theta = np.array([0.7, 1.6])
    full = driven_system(slabbed, [], theta, np.zeros(0), 16.0, ConstantDamping()).system
    grid, none = torch.from_numpy(GRID), torch.zeros(1, 0, dtype=torch.float64)
    zeta = torch.tensor([0.02], dtype=torch.float64)
    exact = full.frf(none, zeta, none, grid)
    system = System(reduction.model)
    found = system.frf(torch.from_numpy(theta)[None], zeta, none, grid)
    assert float((found / exact - 1.0).abs().max()) < 0.02
    without = System(replace(reduction.model, dashpots=None))
    undamped = without.frf(torch.from_numpy(theta)[None], zeta, none, grid)
    assert float((undamped / exact).abs().max()) > 2.0  # dashpots are what damps
    assert system.complex_modes
    assert not without.complex_modes
    saved = type(reduction.model).of_arrays(reduction.model.arrays(), reduction.model.floors)
    np.testing.assert_array_equal(saved.dashpots, reduction.model.dashpots)


def test_dashpots_across_settle_in_a_symmetric_building():
    """What symmetry makes zero is rounding, which changes for ever as shapes are added."""
    bearing = {key: value for key, value in ISOLATORS.items() if key != "cz"}
    made = document(braces=[], springs=[{"at": "*", **bearing}])
    made["sections"]["column"] = rectangle(0.4, 0.4)
    made["grid"]["x"] = {"A": 0.0, "B": 6.0, "C": 12.0}
    made["slabs"] = [{"x": ["A", "C"], "y": ["P", "Q"], "thickness": 0.25, "diaphragm": "rigid"}]
    made["sensors"]["points"] = ["B-P"]
    structure, none = structure_of(from_document(made)), np.zeros(0)
    full = driven_system(structure, [], np.ones(2), none, 16.0, ConstantDamping()).system
    assert full.model.size < 200  # without a bound on what counts, 1200 are not enough


def test_histories_are_those_of_the_frfs(slabbed):
    """A sine of the base, long after its start, moves floors as the FRF says."""
    model = reduce_structure(slabbed, TARGET).model
    system, hz, step = System(model), 1.5, 0.005
    time = step * np.arange(12000)
    base = np.sin(2.0 * np.pi * hz * time)
    parameters, zeta = np.ones((1, 2)), np.array([0.02])
    (found,) = history_batches(system, parameters, zeta, base, step)
    none = torch.zeros(1, 0, dtype=torch.float64)
    grid = torch.tensor([hz], dtype=torch.float64)
    frf = system.frf(torch.ones(1, 2, dtype=torch.float64), torch.from_numpy(zeta), none, grid)
    expected = np.imag(frf[0].numpy() * np.exp(2j * np.pi * hz * time))
    late = slice(9000, None)
    np.testing.assert_allclose(
        found.floor_acceleration[0][:, late], expected[:, late], atol=1e-3 * np.abs(expected).max()
    )
