"""Bases made of weighted shapes, against the generalised singular values of all at once."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from femupdate.dynamics.snapshots import compressed


@pytest.fixture
def mass(rng):
    root = rng.normal(size=(40, 40))
    return csc_matrix(root @ root.T + 40.0 * np.eye(40))


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def test_a_basis_of_parts_holds_the_most_energetic_directions(mass, rng):
    """The best r directions of L^T S, L L^T the mass, are its first r left singular vectors."""
    weight = 0.6 ** np.arange(12.0)
    parts = [rng.normal(size=(40, 12)) * weight for _ in range(3)]
    parts.append(rng.normal(size=(40, 1)))
    basis = compressed(mass, parts, 10)
    np.testing.assert_allclose(basis.T @ mass @ basis, np.eye(10), atol=1e-12)
    lower = np.linalg.cholesky(mass.toarray())
    left = np.linalg.svd(lower.T @ np.concatenate(parts, axis=1))[0][:, :10]
    own = lower.T @ basis
    np.testing.assert_allclose(own @ own.T, left @ left.T, atol=1e-9)
    np.testing.assert_allclose(np.abs(own[:, 0] @ left[:, 0]), 1.0, atol=1e-9)


def test_shapes_that_repeat_others_are_left_out(mass, rng):
    part = rng.normal(size=(40, 5))
    assert compressed(mass, [part, 2.0 * part], 20).shape == (40, 5)


def test_of_many_shapes_a_basis_leaves_hardly_more_than_the_best_one(rng):
    """Thirty directions of 200 shapes, out of seventy combinations; 1.6 % more in three draws."""
    mass = csc_matrix(np.diag(rng.uniform(0.5, 2.0, 300)))
    parts = [rng.normal(size=(300, 50)) * 0.8 ** np.arange(50.0) for _ in range(4)]
    basis = compressed(mass, parts, 30)
    whole = np.sqrt(mass.diagonal())[:, None] * np.concatenate(parts, axis=1)
    own = np.sqrt(mass.diagonal())[:, None] * basis
    best = np.linalg.norm(np.linalg.svd(whole, compute_uv=False)[30:])
    np.testing.assert_allclose(own.T @ own, np.eye(30), atol=1e-12)
    assert np.linalg.norm(whole - own @ (own.T @ whole)) < 1.05 * best
