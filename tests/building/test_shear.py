"""Shear buildings against closed forms, and the damping laws."""

import numpy as np
import pytest
from scipy.linalg import eigh

from femupdate.building import from_document, load_building, shear_operators


def frequencies(operators, theta):
    stiffness = np.einsum("p,pij->ij", theta, operators.stiffness_terms)
    return np.sqrt(eigh(stiffness, operators.mass, eigvals_only=True)) / (2 * np.pi)


@pytest.mark.parametrize(("name", "ratio"), [("shear_4dof", 1000.0), ("shear_3dof", 3000.0)])
def test_uniform_shear_building(name, ratio):
    building = load_building(name)
    operators, count = shear_operators(building), len(building.floors)
    mode = np.arange(1, count + 1)
    # Fixed-free chain of equal masses and springs (textbooks of vibration, such as Blevins 1979).
    omega = 2 * np.sqrt(ratio) * np.sin((2 * mode - 1) * np.pi / (2 * (2 * count + 1)))
    np.testing.assert_allclose(
        frequencies(operators, np.ones(count)), omega / (2 * np.pi), rtol=1e-12
    )
    assert not building.masses_known


def unequal():
    stories = [
        {"name": "S1", "mass": 2e3, "stiffness": 5e6},
        {"name": "S2", "mass": 1e3, "stiffness_per_mass": 3e3},
    ]
    return {
        "name": "two",
        "kind": "shear",
        "stories": stories,
        "frequency_grid": {"start": 0.0, "step": 1.0, "count": 3},
        "prior": {"theta": {"lower": 1, "upper": 2}},
        "damping": {"law": "rayleigh", "ratio": 0.03, "anchors": [2.0, 7.0]},
    }


def test_each_spring_acts_between_its_floors():
    building = from_document(unequal())
    operators = shear_operators(building)
    assert building.masses_known
    np.testing.assert_array_equal(operators.mass, np.diag([2e3, 1e3]))
    np.testing.assert_allclose(operators.stiffness_terms[0], [[5e6, 0], [0, 0]])
    np.testing.assert_allclose(operators.stiffness_terms[1], [[3e6, -3e6], [-3e6, 3e6]])
    # Two degrees of freedom by hand: m1 m2 w^4 - (m1 k2 + m2 (k1 + k2)) w^2 + k1 k2 = 0.
    k1, k2, m1, m2 = 10e6, 1.5e6, 2e3, 1e3
    roots = np.roots([m1 * m2, -(m1 * k2 + m2 * (k1 + k2)), k1 * k2])
    np.testing.assert_allclose(
        frequencies(operators, np.array([2.0, 0.5])),
        np.sqrt(np.sort(roots)) / (2 * np.pi),
        rtol=1e-12,
    )


def test_the_four_equivalent_stiffnesses_share_their_frequencies():
    """Katafygiotis and Lam: seen at the roof, these are the same building as (1, 1, 1, 1)."""
    operators = shear_operators(load_building("shear_4dof"))
    reference = frequencies(operators, np.ones(4))
    for theta in (
        (1.72206, 0.63637, 1.30144, 0.70116),
        (2.0, 1.0, 0.5, 1.0),
        (2.63969, 0.64718, 0.81280, 0.72018),
    ):
        # The factors are printed with five decimals.
        np.testing.assert_allclose(frequencies(operators, np.array(theta)), reference, rtol=1e-5)
