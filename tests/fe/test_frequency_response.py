"""Direct harmonic response against closed forms and modal superposition."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.errors import ModelError
from femupdate.fe.assembly import assemble
from femupdate.fe.frequency_response import (
    harmonic_displacement,
    rayleigh_coefficients,
    rayleigh_damping,
)
from femupdate.fe.model import PointMasses, Springs
from femupdate.fe.solve import static_displacement


@pytest.fixture(scope="module")
def operators(meshes):
    points, parts = meshes.frame_with_wall()
    fixed = meshes.hold(len(points), (points[:, 2] == 0, range(6)))
    return assemble(meshes.model(points, fixed, groups=2, **parts))


THETA = np.array([0.8, 1.3])


def test_one_mass_on_a_spring_with_a_dashpot(meshes):
    k, m, c = 4e5, 250.0, 900.0
    fixed = np.ones((1, 6), dtype=bool)
    fixed[0, 1] = False
    springs = Springs(np.array([[0, -1]]), np.array([1]), np.array([k]), np.array([0]))
    masses = PointMasses(np.array([0]), np.array([m]), np.zeros((1, 3)))
    one = assemble(meshes.model([[0.0, 0, 0]], fixed, springs=springs, masses=masses))
    frequency = np.array([0.0, 3.0, np.sqrt(k / m) / (2 * np.pi), 20.0])
    load = np.array([0, 5.0, 0, 0, 0, 0])
    found = harmonic_displacement(one, np.ones(1), frequency, load, csc_matrix([[c]]))
    omega = 2 * np.pi * frequency
    np.testing.assert_allclose(found[:, 1], 5.0 / (k + 1j * omega * c - omega**2 * m), rtol=1e-10)
    assert not found[:, [0, 2, 3, 4, 5]].any()


def test_all_modes_together_give_the_same(operators):
    """Superposition of every mode with Rayleigh's damping ratios, under base acceleration."""
    alpha, beta = rayleigh_coefficients((5.0, 40.0), 0.02)
    damping = rayleigh_damping(operators, THETA, alpha, beta)
    frequency = np.array([0.5, 7.3, 21.0])
    load = operators.expand(-operators.inertia(1))
    direct = harmonic_displacement(operators, THETA, frequency, load, damping)
    values, shapes = eigh(operators.stiffness(THETA).toarray(), operators.mass.toarray())
    own, omega = np.sqrt(values), 2 * np.pi * frequency[:, None]
    zeta = 0.5 * (alpha / own + beta * own)
    transfer = 1 / (own**2 + 2j * zeta * own * omega - omega**2)
    modal = (transfer * (shapes.T @ operators.restrict(load))) @ shapes.T
    # The dense eigenproblem loses cond(K) eps ~ 1e-8 in its softest modes.
    for found, wanted in zip(direct[:, operators.free], modal, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-7 * np.abs(wanted).max())


def test_zero_frequency_is_static(operators):
    load = np.random.default_rng(2).standard_normal(operators.dof)
    damping = rayleigh_damping(operators, THETA, 0.5, 1e-3)
    found = harmonic_displacement(operators, THETA, np.array([0.0]), load, damping)
    wanted = static_displacement(operators, THETA, load)
    np.testing.assert_allclose(found[0], wanted, atol=1e-10 * np.abs(wanted).max())


def test_an_undamped_resonance_is_refused(meshes):
    frequency = 3.0
    fixed = np.ones((1, 6), dtype=bool)
    fixed[0, 2] = False
    stiffness = np.array([(2 * np.pi * frequency) ** 2])
    springs = Springs(np.array([[0, -1]]), np.array([2]), stiffness, np.array([0]))
    masses = PointMasses(np.array([0]), np.ones(1), np.zeros((1, 3)))
    one = assemble(meshes.model([[0.0, 0, 0]], fixed, springs=springs, masses=masses))
    none = csc_matrix((1, 1))
    with pytest.raises(ModelError, match="at 3 Hz has no finite value"):
        harmonic_displacement(one, np.ones(1), np.array([2.0, frequency]), np.ones(6), none)


def test_rayleigh_coefficients_give_zeta_at_both_frequencies():
    alpha, beta = rayleigh_coefficients((9.0, 2.0), 0.03)
    for frequency in (2.0, 9.0):
        omega = 2 * np.pi * frequency
        assert 0.5 * (alpha / omega + beta * omega) == pytest.approx(0.03, rel=1e-12)


@pytest.mark.parametrize("pair", [(2.0, 2.0), (0.0, 3.0), (-1.0, 3.0)])
def test_rayleigh_refuses_impossible_frequencies(pair):
    with pytest.raises(ModelError, match="two different positive frequencies"):
        rayleigh_coefficients(pair, 0.02)
