"""Shear buildings against closed forms, and the damping laws."""

import numpy as np
from scipy.linalg import eigh

from femupdate.building import from_document, shear_operators


def frequencies(operators, theta):
    stiffness = np.einsum("p,pij->ij", theta, operators.stiffness_terms)
    return np.sqrt(eigh(stiffness, operators.mass, eigvals_only=True)) / (2 * np.pi)


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
