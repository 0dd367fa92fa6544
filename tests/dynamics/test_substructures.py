"""Parts of a structure against its full matrices, which sparse solvers of SciPy take whole."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse.linalg import spsolve

from femupdate.dynamics.reduction import substructures


@pytest.fixture(scope="module", params=[(3.4, 2.9), (3.0, 3.0, 3.0, 3.0)])
def structure(request, small_frame):
    return small_frame(1.0, request.param).structure


@pytest.fixture(scope="module")
def parts(structure):
    return substructures(structure, 60.0)


@pytest.fixture(scope="module")
def motions(structure, parts):
    """Random coordinates (q, 3) and loads (n, 3)."""
    rng = np.random.default_rng(1)
    loads = rng.standard_normal((len(structure.axis), 3))
    return rng.standard_normal(parts.condensed(loads).shape), loads


@pytest.fixture(scope="module")
def theta(structure):
    return np.resize([0.6, 2.2, 1.3], len(structure.stiffness_terms))


def test_inertia_is_met_without_loss(structure, parts, motions, theta):
    """K^-1 M of some shapes, and K^-1 f, at any theta lie among the coordinates made of them."""
    shapes = motions[0]
    fine, there = parts.with_inertia(shapes)
    np.testing.assert_allclose(fine.expanded(there), parts.expanded(shapes), atol=1e-9)
    loads = np.hstack([structure.mass @ parts.expanded(shapes), structure.rigid_force[:, :1]])
    found = fine.at(theta).apply(fine.condensed(loads))
    expected = spsolve(structure.stiffness(theta), loads)
    size = np.abs(expected).max()
    np.testing.assert_allclose(fine.expanded(found), expected, rtol=1e-6, atol=1e-9 * size)


def test_mass_and_stiffness_are_projected(structure, parts, motions, theta):
    """T^T M T and T^T K T, and their inverse, by shapes and loads of the full model."""
    shapes, loads = motions
    full, joined = parts.expanded(shapes), parts.at(theta)
    np.testing.assert_allclose(np.vdot(parts.condensed(loads), shapes), np.vdot(loads, full))
    np.testing.assert_allclose(parts @ shapes, parts.condensed(structure.mass @ full), atol=1e-7)
    held = parts.condensed(structure.stiffness(theta) @ full)
    np.testing.assert_allclose(joined.times(shapes), held, atol=1e-9 * np.abs(held).max())
    np.testing.assert_allclose(joined.apply(joined.times(shapes)), shapes, atol=1e-6)


def test_modes_come_from_above_and_nearer_with_inertia(structure, parts, theta):
    """Rayleigh and Ritz: more shapes never raise a frequency."""
    exact = eigh(structure.stiffness(theta).toarray(), structure.mass.toarray(), eigvals_only=True)

    def errors(part):
        unit = np.eye(len(part.condensed(structure.rigid_force)))
        values, vectors = eigh(part.at(theta).times(unit), part @ unit)
        return values[:8] / exact[:8] - 1.0, vectors[:, :8]

    coarse, shapes = errors(parts)
    fine, _ = errors(parts.with_inertia(shapes)[0])
    assert (fine > -1e-8).all()
    assert coarse.max() < 0.03
    assert fine.max() < 0.05 * coarse.max()


def test_a_coarse_mesh_is_all_joints(small_frame):
    assert substructures(small_frame(3.0).structure, 60.0) is None


def test_stories_of_one_plan_are_solved_once(small_frame):
    equal, unequal = (
        substructures(small_frame(1.0, heights).structure, 60.0).parts
        for heights in ((3.0, 3.0, 3.0, 3.0), (3.0, 3.0, 3.1, 3.0))
    )
    assert equal[1].moved is equal[2].moved
    assert unequal[1].moved is not unequal[2].moved
