"""The four-story benchmark as a whole: its truth, its tables and its small run."""

import numpy as np
import pytest
from femupdate.benchmarks.shear4dof.case import (
    PUBLISHED_SOLUTIONS,
    authors_case,
    case_modes,
    exact_posterior,
    random_case,
    roof_log_frf,
)
from femupdate.benchmarks.shipped import benchmark_model

# Long runs of another sampler over the exact likelihood.
WEIGHT = [0.337, 0.132, 0.346, 0.185]
SD = [
    [0.0071, 0.0058, 0.0045, 0.0067],
    [0.0073, 0.0052, 0.0048, 0.0022],
    [0.0269, 0.0114, 0.0036, 0.0028],
    [0.0117, 0.0046, 0.0043, 0.0037],
]


@pytest.fixture(scope="module")
def model():
    return benchmark_model()


def test_exact_posterior(model):
    case = authors_case(model)
    np.testing.assert_allclose(case.solutions, PUBLISHED_SOLUTIONS, atol=5e-6)
    found = exact_posterior(model, case, draws=10_000, seed=4, particles=1000)
    assert found.weighted.log_evidence == pytest.approx(-580.90, abs=0.03)
    assert found.weighted.log_evidence_error < 0.005
    # 15,000 effective draws: .004 for a weight, and 1.5 % for the rarest mode's deviations.
    np.testing.assert_allclose(found.modes.weight, WEIGHT, atol=0.015)
    np.testing.assert_allclose(found.modes.sd, SD, rtol=0.08)


def test_random_cases_have_the_truth_among_their_solutions(model):
    case = random_case(model, np.random.default_rng(3))
    assert np.abs(case.solutions - case.theta).max(axis=1).min() < 1e-6
    roofs = roof_log_frf(model, case.solutions)[:, -1]
    np.testing.assert_allclose(roofs, roofs[[0]].repeat(len(roofs), 0), atol=1e-4)
    near = case.solutions + 0.5 * case.sd
    np.testing.assert_array_equal(case_modes(case, near).member, np.arange(len(near)))
