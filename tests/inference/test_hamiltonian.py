"""Chains from the maxima of a posterior, against closed forms and quadrature."""

import numpy as np
import pytest
import torch

from femupdate.errors import InferenceError
from femupdate.inference.hamiltonian import HamiltonianSettings, hamiltonian_draws
from femupdate.inference.laplace import LaplaceSettings, laplace_start

LINEAR = (
    np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]]),
    np.array([1.3, -0.8, 2.1, 0.4]),
    0.3,
)


def likelihood(residuals):
    return lambda theta: -0.5 * residuals(theta).square().sum(1)


def test_a_linear_problem(box, linear_gaussian):
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), linear_gaussian(*LINEAR)
    matrix, data = torch.from_numpy(exact.A), torch.from_numpy(exact.y)
    start = laplace_start(prior, lambda t: (prior.to_normal(t) @ matrix.T - data) / exact.s, 0)
    target = exact.on(prior)
    found = hamiltonian_draws(prior, target, start, 16, 200, 1)
    assert found.theta.shape == (16, 200, 3)
    assert 0.6 < found.acceptance < 0.95
    torch.testing.assert_close(found.log_likelihood[3], target(found.theta[3]))
    xi = prior.to_normal(found.theta.reshape(-1, 3)).numpy()
    sd = np.sqrt(np.diag(exact.covariance))
    # 3,200 draws, a third of them independent at least: .03 sd, and 2 % of a standard deviation.
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.12)
    np.testing.assert_allclose(xi.std(0) / sd, 1.0, atol=0.1)


def test_a_bent_posterior_that_no_gaussian_covers(box):
    """One combination known to a hundredth along a parabola; moments by quadrature."""
    prior = box([0.0, 0.0], [1.0, 1.0])

    def residuals(theta):
        xi = prior.to_normal(theta)
        return ((xi[:, 1] + xi[:, 0] ** 2 - 1.0) / 0.01)[:, None]

    start = laplace_start(prior, residuals, 0)
    target = likelihood(residuals)
    assert start.effective_share(target, 400, 0) < 0.2
    found = hamiltonian_draws(prior, target, start, 32, 400, 1)
    xi = prior.to_normal(found.theta).numpy()
    # Across the parabola the likelihood is a narrow Gaussian: integrated out.
    x = np.linspace(-5.0, 5.0, 4001)
    density = np.exp(-0.5 * (x**2 + (1.0 - x**2) ** 2))
    density /= density.sum()
    square = density @ x**2
    spread = np.sqrt(density @ x**4 - square**2)
    # The chains' own means of x^2 tell how well theirs is known.
    means = (xi[..., 0] ** 2).mean(1)
    error = means.std(ddof=1) / np.sqrt(len(means))
    assert error < 0.1 * spread
    assert abs(means.mean() - square) < 4.0 * error
    assert abs(xi[..., 1] + xi[..., 0] ** 2 - 1.0).std() == pytest.approx(0.006, abs=0.001)


def test_separate_maxima_share_the_chains_by_their_masses(box):
    prior = box([0.0, 0.0], [1.0, 1.0])

    def residuals(theta):
        xi = prior.to_normal(theta)
        return torch.stack([(xi[:, 0] ** 2 - 1.0) / 0.05, (xi[:, 1] - 0.5) / 0.1], dim=1)

    start = laplace_start(prior, residuals, 0, LaplaceSettings(starts=20))
    short = HamiltonianSettings(warm_up=20)
    found = hamiltonian_draws(prior, likelihood(residuals), start, 10, 20, 1, short)
    side = prior.to_normal(found.theta)[..., 0] > 0.0
    assert int(side[:, 0].sum()) == 5
    assert bool((side == side[:, :1]).all())


def test_the_same_seed_gives_the_same_draws(box):
    prior = box([0.0], [1.0])
    start = laplace_start(prior, lambda theta: theta - 0.3, 0)
    first, again, other = (
        hamiltonian_draws(prior, likelihood(lambda t: t - 0.3), start, 4, 5, seed)
        for seed in (1, 1, 2)
    )
    assert torch.equal(first.theta, again.theta)
    assert not torch.equal(first.theta, other.theta)


def test_a_likelihood_that_is_nowhere_finite(box):
    prior = box([0.0], [1.0])
    start = laplace_start(prior, lambda theta: theta - 0.3, 0)
    broken = likelihood(lambda theta: theta * torch.nan)
    assert start.effective_share(broken, 50, 0) == 0.0
    with pytest.raises(InferenceError, match="no chain has a finite likelihood"):
        hamiltonian_draws(prior, broken, start, 4, 5, 0)
