"""Gaussians at the maxima of a posterior, against closed forms."""

import numpy as np
import pytest
import torch

from femupdate.errors import InferenceError
from femupdate.inference.bridge import Start, bridge
from femupdate.inference.laplace import LaplaceSettings, laplace_start
from femupdate.inference.smc import SmcResult

PROBLEM = (
    np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]]),
    np.array([1.3, -0.8, 2.1, 0.4]),
    0.3,
)


def linear(prior):
    a, y, sd = PROBLEM
    matrix, data = torch.from_numpy(a), torch.from_numpy(y)
    return lambda theta: (prior.to_normal(theta) @ matrix.T - data) / sd


def test_a_linear_problem_is_its_own_gaussian(box, linear_gaussian):
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), linear_gaussian(*PROBLEM)
    start = laplace_start(prior, linear(prior), 0)
    assert start.reached == (12,)
    gaussian = start.proposal.gaussian
    np.testing.assert_allclose(gaussian.mean[0], exact.mean, atol=1e-6)
    covariance = gaussian.cholesky[0] @ gaussian.cholesky[0].T
    np.testing.assert_allclose(covariance, exact.covariance, rtol=1e-5, atol=1e-8)


def test_the_bridge_from_it_has_the_exact_evidence(box, linear_gaussian):
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), linear_gaussian(*PROBLEM)
    start = laplace_start(prior, linear(prior), 0)
    draws = start.draw(1000, 1)
    base = start.log_likelihood(draws)
    result = SmcResult(draws, base, 0.0, (), 0, 0)
    found = bridge(prior, exact.on(prior), Start(result, start.log_likelihood), 2)
    assert found.log_evidence == pytest.approx(exact.log_evidence, abs=0.05)
    xi = prior.to_normal(found.theta).numpy()
    sd = np.sqrt(np.diag(exact.covariance))
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.12)


def test_the_base_integrates_to_one(box, linear_gaussian):
    """Mean of base over draws of the prior."""
    prior = box([0.0, 0.0], [1.0, 3.0])
    matrix = torch.tensor([[1.0, 0.5]], dtype=torch.float64)
    start = laplace_start(prior, lambda theta: prior.to_normal(theta) @ matrix.T - 0.4, 3)
    drawn = prior.sample(200_000, torch.Generator().manual_seed(1))
    assert float(start.log_likelihood(drawn).exp().mean()) == pytest.approx(1.0, abs=0.03)


def test_two_maxima_are_both_found(box):
    prior = box([0.0, 0.0], [1.0, 1.0])

    def residuals(theta):
        xi = prior.to_normal(theta)
        return torch.stack([(xi[:, 0] ** 2 - 1.0) / 0.05, (xi[:, 1] - 0.5) / 0.1], dim=1)

    start = laplace_start(prior, residuals, 0, LaplaceSettings(starts=20))
    assert sum(start.reached) == 20
    assert len(start.reached) == 2
    mean = start.proposal.gaussian.mean
    np.testing.assert_allclose(mean[:, 0].sort().values, [-0.9975, 0.9975], atol=2e-3)
    np.testing.assert_allclose(start.proposal.gaussian.log_weight.exp(), 0.5, atol=1e-3)


@pytest.mark.filterwarnings("ignore")
def test_residuals_that_are_nowhere_finite(box):
    with pytest.raises(InferenceError, match="none of 2000 parameter sets"):
        laplace_start(box([0.0], [1.0]), lambda theta: theta * torch.nan, 0)
