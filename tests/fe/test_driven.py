"""Shapes that forces drive, against the dynamic stiffness solved frequency by frequency."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags

from femupdate.errors import StructureError
from femupdate.fe import PointMasses, assemble, driven_shapes, factorize
from tests.fe import meshes

ROWS = np.eye(400)[[50, 399]]


@pytest.fixture(scope="module")
def rod():
    """A chain of 400 masses, held at one end: stiffness, mass, and frequencies of 1 to 8 Hz."""
    spring = 1e6
    stiffness = spring * diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(400, 400), format="lil")
    stiffness[399, 399] = spring
    mass = diags(np.linspace(1.0, 2.0, 400) * 1.5)
    return csc_matrix(stiffness), csc_matrix(mass)


def both(found, matrices, forces, rows, frequency, loss=0.0):
    """What rows show under forces at a frequency, by shapes and by the full matrices."""
    w2, squared = (2 * np.pi * frequency) ** 2, (2 * np.pi * found.frequency_hz) ** 2 * (1 + loss)
    flexible = (found.shapes.T @ forces) / (squared - w2)[:, None]
    K, M = (part.toarray() for part in matrices)
    return rows @ found.shapes @ flexible, rows @ np.linalg.solve(K * (1 + loss) - w2 * M, forces)


def test_they_give_the_response_to_every_force(rod):
    forces = np.column_stack([rod[1].diagonal(), np.eye(400)[120]])
    found = driven_shapes(factorize(rod[0]), rod[1], forces, ROWS, 8.0)
    assert found.shapes.shape[1] < 200
    for frequency in (0.3, 2.2, 5.1, 7.9):
        ours, exact = both(found, rod, forces, ROWS, frequency)
        np.testing.assert_allclose(ours, exact, rtol=1e-3, atol=1e-5 * np.abs(exact).max())


def test_watched_rows_are_right_though_they_start_no_shapes(rod):
    """The force in a spring next to where the rod is driven, which local shapes make."""
    force, spring = np.eye(400)[:, [120]], 1e6 * (np.eye(400)[[121]] - np.eye(400)[[120]])
    group = np.concatenate([spring, np.zeros((1, 400))])  # symmetry's zero asks for no shape
    solved, M = factorize(rod[0]), rod[1]
    plain = driven_shapes(solved, M, force, ROWS, 8.0)
    found = driven_shapes(solved, M, force, ROWS, 8.0, watched=(group,))
    assert plain.shapes.shape[1] <= found.shapes.shape[1] < 200
    for frequency in (0.3, 2.2, 5.1, 7.9):
        np.testing.assert_allclose(*both(found, rod, force, spring, frequency), rtol=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_masses_at_a_few_nodes_alone(seed):
    rng = np.random.default_rng(seed)
    points = np.array([(x, 0.0, z) for z in (0.0, 3.0, 6.0, 9.0) for x in (0.0, 5.0, 10.0)])
    lines = [[k, k + 3] for k in range(9)] + [[k, k + 1] for k in range(3, 11) if k % 3 < 2]
    frame = meshes.beams(lines, up=(0.3, 1.0, 0.1), **{**meshes.SECTION, "density": 0.0})
    massed = 3 + rng.permutation(9)[: rng.integers(1, 5)]
    masses = PointMasses(massed, np.full(len(massed), 2e4), np.zeros((len(massed), 3)))
    held = np.repeat(points[:, 2:] == 0.0, 6, axis=1)
    whole = assemble(meshes.model(points, held, beams=frame, masses=masses))
    K, M = whole.stiffness(np.ones(1)), whole.mass
    unit = whole.gather(np.eye(72)[:, ::6])  # along x, at every node
    forces = np.column_stack([unit[:, massed].sum(axis=1), unit[:, rng.integers(3, 12)]])
    rows = unit[:, [5, 9]].T
    found = driven_shapes(factorize(K), M, forces, rows, 30.0)
    for frequency in (0.7, 4.0, 11.0, 29.0):  # damped, so that no resonance is hit
        np.testing.assert_allclose(*both(found, (K, M), forces, rows, frequency, 0.04j), rtol=1e-5)


@pytest.mark.parametrize("seed", [7, 8, 59])  # with 8 and 59, rounding once stayed as shapes
def test_forces_that_drive_some_modes_alone_lead_to_no_shape_twice(seed):
    rng = np.random.default_rng(seed)
    turned, _ = np.linalg.qr(rng.standard_normal((14, 14)))
    hz = np.array([3.3, 3.4, 3.9, 11.3, 11.4, 12.2, 38.1, 38.2, 38.3, 38.4, 99, 99.1, 99.2, 99.3])
    K = turned @ np.diag((2 * np.pi * hz) ** 2) @ turned.T
    force = np.eye(14)[:, [0, 5, 7, 11]] @ [[240], [140], [0.5], [0.5]]
    rows = rng.standard_normal((2, 7)) * ([1] * 4 + [1e-3] * 3) @ np.eye(14)[[0, 2, 4, 5, 6, 8, 12]]
    solved, M = factorize(csc_matrix(0.5 * (K + K.T))), csc_matrix(np.eye(14))
    found = driven_shapes(solved, M, turned @ force, rows @ turned.T, 24.7)
    np.testing.assert_allclose(found.frequency_hz, hz, rtol=1e-6)


def test_a_negative_stiffness_is_refused():
    K, ones = factorize(csc_matrix(np.diag([4.0, -1.0]))), np.eye(2)
    with pytest.raises(StructureError, match="negative stiffness"):
        driven_shapes(K, csc_matrix(ones), ones, ones, 1.0)
