"""Populations that Hamiltonian moves carry from the prior, against closed forms and quadrature."""

import math

import numpy as np
import pytest
import torch

from femupdate.inference import SmcSettings, TemperedSmc
from femupdate.inference.importance import students
from femupdate.inference.smc import Hamiltonian
from tests.inference.gaussians import LinearGaussian, box


def drawn(prior, target, draws, seed=0, particles=128, groups=4, start=None):
    """Draws (groups, n, p) of a population, and what each group's run says."""
    sampler = TemperedSmc(prior, target, SmcSettings(unmoved=0.0), ((Hamiltonian(), 3),), start)
    runs = sampler.draws(particles, draws, seed, groups)
    return torch.stack([run.theta for run in runs]), runs


@pytest.fixture
def linear():
    prior = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0])
    slopes = np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]])
    exact = LinearGaussian(slopes, np.array([1.3, -0.8, 2.1, 0.4]), 0.3)
    return prior, exact, exact.on(prior)


def assert_moments(prior, exact, theta):
    xi = prior.to_normal(theta.reshape(-1, 3)).numpy()
    sd = np.sqrt(np.diag(exact.covariance))
    # 128 particles that forget where they were in a few moves: .05 sd at most, 4 % of one.
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.15)
    np.testing.assert_allclose(xi.std(0) / sd, 1.0, atol=0.12)


@pytest.mark.parametrize("beside", [False, True])
def test_a_linear_problem_with_its_evidence(linear, beside):
    """From the prior, and from two standard deviations off, thrice as wide as the posterior."""
    prior, exact, target = linear
    off = torch.from_numpy(exact.mean + 2.0 * np.sqrt(np.diag(exact.covariance)))
    start = students(off[None], torch.from_numpy(9.0 * exact.covariance)[None], torch.zeros(1))
    theta, runs = drawn(prior, target, 2000, start=start if beside else None)
    assert theta.shape == (4, 512, 3)
    torch.testing.assert_close(runs[3].log_likelihood, target(theta[3]))
    assert_moments(prior, exact, theta)
    assert 0.5 < runs[0].acceptance < 0.95
    # Groups of 32 err by some .5 each from the prior, by .15 from there.
    evidence = np.array([run.log_evidence for run in runs])
    assert evidence.mean() == pytest.approx(exact.log_evidence, abs=0.3 if beside else 0.6)
    assert 0.01 < evidence.std(ddof=1) < 1.5


def test_a_bent_posterior_that_no_gaussian_covers():
    """One combination known to a hundredth along a parabola; moments by quadrature."""
    prior = box([0.0, 0.0], [1.0, 1.0])

    def target(theta):
        xi = prior.to_normal(theta)
        return -0.5 * ((xi[:, 1] + xi[:, 0] ** 2 - 1.0) / 0.01).square()

    theta, runs = drawn(prior, target, 5000, particles=1024)
    xi = prior.to_normal(theta)
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
    told = np.mean([run.log_evidence for run in runs])
    assert told == pytest.approx(evidence, abs=0.3)
