"""Stiffness vectors that share a roof response, against their responses and random search."""

import numpy as np
from femupdate.benchmarks.shear4dof.equivalent import equivalent_stiffness
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from femupdate.errors import InferenceError


def frequency_response(stiffness, mass, omega, a0=0.3, a1=2e-4):
    """Absolute over base acceleration of all floors (n, k), by direct solution."""
    count = len(stiffness)
    drift = np.eye(count) - np.eye(count, k=1)
    K, M = drift @ np.diag(stiffness) @ drift.T, np.diag(mass)
    C = a0 * M + a1 * K
    solved = [np.linalg.solve(K + 1j * w * C - w**2 * M, w**2 * M @ np.ones(count)) for w in omega]
    return 1.0 + np.array(solved).T


positive = st.floats(0.3, 3.0)


@settings(max_examples=8, deadline=None)
@given(st.lists(st.tuples(positive, positive), min_size=2, max_size=4))
def test_damped_roof_response_is_the_same(pairs):
    stiffness, mass = (np.array(column) for column in zip(*pairs, strict=True))
    try:
        found = equivalent_stiffness(1000.0 * stiffness, mass)
    except InferenceError:  # two solutions coincide: a set of measure zero that hypothesis likes
        reject()
    omega = np.linspace(1.0, 120.0, 40)
    reference = frequency_response(1000.0 * stiffness, mass, omega)[-1]
    for row in found:
        again = frequency_response(row, mass, omega)[-1]
        # Peaks magnify the 1e-9 of Newton's last step.
        np.testing.assert_allclose(again, reference, rtol=1e-5)
