"""Shapes that forces drive, against the dynamic stiffness solved frequency by frequency."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags

from femupdate.fe import driven_shapes, factorize

ROWS = np.eye(400)[[50, 399]]


@pytest.fixture(scope="module")
def rod():
    """A chain of 400 masses, held at one end: stiffness, mass, and frequencies of 1 to 8 Hz."""
    spring = 1e6
    stiffness = spring * diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(400, 400), format="lil")
    stiffness[399, 399] = spring
    mass = diags(np.linspace(1.0, 2.0, 400) * 1.5)
    return csc_matrix(stiffness), csc_matrix(mass)


def displacement(rod, force, frequency_hz, zeta=None):
    K, M = (part.toarray() for part in rod)
    return np.linalg.solve(K - (2 * np.pi * frequency_hz) ** 2 * M, force)


def test_they_give_the_response_to_every_force(rod):
    K, M = rod
    forces = np.column_stack([M.diagonal(), np.eye(400)[120]])
    found = driven_shapes(factorize(K), M, forces, ROWS, 8.0)
    assert found.shapes.shape[1] < 200
    omega = 2 * np.pi * found.frequency_hz
    for frequency in (0.3, 2.2, 5.1, 7.9):
        ours = (
            ROWS
            @ found.shapes
            @ ((found.shapes.T @ forces) / (omega**2 - (2 * np.pi * frequency) ** 2)[:, None])
        )
        exact = ROWS @ displacement(rod, forces, frequency)
        np.testing.assert_allclose(ours, exact, rtol=1e-3, atol=1e-5 * np.abs(exact).max())


def test_watched_rows_are_right_though_they_start_no_shapes(rod):
    """The force in a spring next to where the rod is driven, which local shapes make."""
    K, M = rod
    force, spring = np.eye(400)[:, [120]], 1e6 * (np.eye(400)[[121]] - np.eye(400)[[120]])
    nothing = np.zeros((1, 400))  # a force that symmetry makes zero asks for no shape
    group = np.concatenate([spring, nothing])
    plain = driven_shapes(factorize(K), M, force, ROWS, 8.0)
    found = driven_shapes(factorize(K), M, force, ROWS, 8.0, watched=(group,))
    assert plain.shapes.shape[1] <= found.shapes.shape[1] < 200
    omega = 2 * np.pi * found.frequency_hz
    for frequency in (0.3, 2.2, 5.1, 7.9):
        flexible = (found.shapes.T @ force) / (omega**2 - (2 * np.pi * frequency) ** 2)[:, None]
        exact = spring @ displacement(rod, force, frequency)
        np.testing.assert_allclose(spring @ found.shapes @ flexible, exact, rtol=1e-3)
