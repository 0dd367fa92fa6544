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
    weight = 0.3 ** np.arange(12.0)
    parts = [rng.normal(size=(40, 12)) * weight for _ in range(3)]
    parts.append(rng.normal(size=(40, 1)))
    basis = compressed(mass, parts, 20)
    np.testing.assert_allclose(basis.T @ mass @ basis, np.eye(20), atol=1e-12)
    lower = np.linalg.cholesky(mass.toarray())
    whole = lower.T @ np.concatenate(parts, axis=1)
    left, size, _ = np.linalg.svd(whole)
    own = lower.T @ basis
    # What a basis leaves; five random combinations more than wanted cost a few per cent.
    lost = np.linalg.norm(whole - own @ (own.T @ whole))
    assert lost < 1.3 * np.linalg.norm(size[20:])
    np.testing.assert_allclose(np.abs(own[:, :4].T @ left[:, :4]), np.eye(4), atol=1e-3)


def test_shapes_that_repeat_others_are_left_out(mass, rng):
    part = rng.normal(size=(40, 5))
    assert compressed(mass, [part, 2.0 * part], 20).shape == (40, 5)
