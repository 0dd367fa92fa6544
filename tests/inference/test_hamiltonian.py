"""Populations that Hamiltonian moves carry from the prior, against closed forms and quadrature."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.errors import InferenceError
from femupdate.inference.hamiltonian import DelayedAcceptance
from femupdate.inference.smc import POPULATION, TRAJECTORIES, TemperedSmc

LINEAR = (
    np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]]),
    np.array([1.3, -0.8, 2.1, 0.4]),
    0.3,
)


def sampler(prior, target, base=None, settings=POPULATION, moves=TRAJECTORIES):
    return TemperedSmc(prior, target, base, settings, moves)


def drawn(prior, target, draws, seed=0, particles=128, settings=POPULATION):
    walk = sampler(prior, target, settings=settings)
    return walk.draws(walk.reach(walk.init(particles, seed)), draws)


@pytest.fixture
def linear(box, linear_gaussian):
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), linear_gaussian(*LINEAR)
    return prior, exact, exact.on(prior)


def assert_moments(prior, exact, theta):
    xi = prior.to_normal(theta.reshape(-1, 3)).numpy()
    sd = np.sqrt(np.diag(exact.covariance))
    # 128 particles that forget where they were in a few moves: .05 sd at most, 4 % of one.
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.15)
    np.testing.assert_allclose(xi.std(0) / sd, 1.0, atol=0.12)


def test_a_linear_problem_with_its_evidence(linear):
    prior, exact, target = linear
    found = drawn(prior, target, 2000)
    assert found.theta.shape == (4, 512, 3)
    torch.testing.assert_close(found.log_likelihood[3], target(found.theta[3]))
    assert_moments(prior, exact, found.theta)
    # Groups of 32 err by some .5 each.
    evidence = np.array(found.state.log_evidence)
    assert evidence.mean() == pytest.approx(exact.log_evidence, abs=0.6)
    assert 0.01 < evidence.std(ddof=1) < 1.5


def test_from_one_likelihood_to_another(linear, linear_gaussian):
    """The evidence of the second whatever was between."""
    prior, exact, target = linear
    matrix, data, noise = LINEAR
    base = linear_gaussian(matrix[:3], data[:3] + 0.4, 2.0 * noise).on(prior)
    first, second = sampler(prior, base), sampler(prior, target, base)
    between = first.reach(first.init(128, 0))
    reached = second.reach(second.taken_over(between, 1))
    found = second.draws(reached, 2000)
    assert_moments(prior, exact, found.theta)
    assert np.mean(found.state.log_evidence) == pytest.approx(exact.log_evidence, abs=0.6)
    assert found.state.evaluations > reached.evaluations > between.evaluations
    assert len(reached.levels) > len(between.levels)


def test_moves_along_a_cheap_likelihood_draw_the_dear_one(linear, linear_gaussian):
    """The cheap one is shifted by about a standard deviation and wider."""
    prior, exact, target = linear
    matrix, data, noise = LINEAR
    cheap = linear_gaussian(matrix, data + np.array([0.2, -0.2, 0.2, 0.1]), 1.3 * noise).on(prior)
    first = sampler(prior, cheap)
    between = first.reach(first.init(128, 0))
    asked = []

    def dear(theta):
        asked.append(len(theta))
        return target(theta)

    second = sampler(prior, dear, cheap, moves=((DelayedAcceptance(), 3),))
    found = second.draws(second.reach(second.taken_over(between, 1)), 4000)
    assert_moments(prior, exact, found.theta)
    torch.testing.assert_close(found.log_likelihood[2], target(found.theta[2]))
    assert found.state.evaluations == between.evaluations + sum(asked)
    assert 0.3 < found.acceptance < 0.9


def test_a_bent_posterior_that_no_gaussian_covers(box):
    """One combination known to a hundredth along a parabola; moments by quadrature."""
    prior = box([0.0, 0.0], [1.0, 1.0])

    def target(theta):
        xi = prior.to_normal(theta)
        return -0.5 * ((xi[:, 1] + xi[:, 0] ** 2 - 1.0) / 0.01).square()

    found = drawn(prior, target, 5000, particles=1024)
    xi = prior.to_normal(found.theta)
    # Across the parabola the likelihood is a narrow Gaussian: integrated out.
    x = np.linspace(-5.0, 5.0, 4001)
    density = np.exp(-0.5 * (x**2 + (1.0 - x**2) ** 2))
    step = x[1] - x[0]
    evidence = math.log(0.01 * density.sum() * step / math.sqrt(2.0 * math.pi))
    density /= density.sum()
    square = density @ x**2
    # 1,024 particles: .024 if they were independent; with common ancestors .03.
    assert float(xi[..., 0].square().mean()) == pytest.approx(square, abs=0.1)
    assert float((xi[..., 1] + xi[..., 0] ** 2 - 1.0).std()) == pytest.approx(0.01, rel=0.15)
    assert np.mean(found.state.log_evidence) == pytest.approx(evidence, abs=0.3)


def test_separate_parts_are_drawn_by_their_masses_and_not_by_their_heights(box):
    """The lower of two maxima has three quarters of the mass."""
    prior = box([0.0] * 3, [1.0] * 3)
    places = torch.tensor([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], dtype=torch.float64)
    widths, shares = torch.tensor([0.1, 0.3]).double(), torch.tensor([0.25, 0.75]).double()

    def target(theta):
        xi = prior.to_normal(theta)
        misfit = (xi[:, None] - places).square().sum(2) / widths**2
        # Over the prior the parts are Gaussians of these shares.
        log_part = shares.log() - 3.0 * widths.log() - 0.5 * misfit
        return torch.logsumexp(log_part, 1) + 0.5 * xi.square().sum(1)

    found = drawn(prior, target, 1000, particles=256)
    share = float((prior.to_normal(found.theta)[..., 0] > 0.0).double().mean())
    # 256 particles, resampled at each of a few powers: .05.
    assert share == pytest.approx(0.75, abs=0.15)


def test_the_same_seed_gives_the_same_draws(box):
    prior = box([0.0], [1.0])
    few = replace(POPULATION, groups=2)

    def target(theta):
        return -0.5 * (10.0 * (theta[:, 0] - 0.3)).square()

    first, again, other = (drawn(prior, target, 20, seed, 16, few) for seed in (1, 1, 2))
    assert torch.equal(first.theta, again.theta)
    assert not torch.equal(first.theta, other.theta)


def test_a_likelihood_that_is_finite_in_places_only(box):
    """Where it is no number it is impossible; where it is nowhere one, that is said."""
    prior = box([0.0, 0.0], [1.0, 1.0])

    def target(theta):
        return torch.log(theta[:, 0] - 0.5)  # no number below a half

    found = drawn(prior, target, 1000)
    assert float(found.theta[..., 0].min()) > 0.5
    # Density proportional to theta - 1/2: mean 5/6.
    assert float(found.theta[..., 0].mean()) == pytest.approx(5.0 / 6.0, abs=0.02)
    with pytest.raises(InferenceError, match="of the 32 first parameter sets has a finite"):
        sampler(prior, lambda theta: theta[:, 0] * torch.nan).init(128, 0)
