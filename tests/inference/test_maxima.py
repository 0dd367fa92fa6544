"""Importance draws about maxima against closed forms, from starts that are only near."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from femupdate.dynamics import System
from femupdate.inference import (
    Parameter,
    Parameters,
    base_logs,
    draws_about,
    found_from,
    likelihood_of,
    on_fewer_shapes,
    settled,
)
from femupdate.inference.importance import Mixture, draws_about_particles, fit_mixture
from femupdate.measurement import Observation
from tests.chains import Chain
from tests.documents import reduced_stick
from tests.inference.gaussians import LinearGaussian, box

PROBLEM = (
    np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]]),
    np.array([1.3, -0.8, 2.1, 0.4]),
    1e-3,
)


def test_a_posterior_a_thousand_times_narrower_than_its_prior():
    """From starts hundreds of its standard deviations off, several of which end in one maximum."""
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), LinearGaussian(*PROBLEM)
    A, y = torch.from_numpy(exact.A), torch.from_numpy(exact.y)

    def residuals(theta):
        return (prior.to_normal(theta) @ A.T - y) / exact.s

    starts = prior.sample(3, torch.Generator().manual_seed(1))
    found = draws_about(prior, exact.on(prior), found_from(prior, residuals, starts), 4000, 2)
    assert found.effective > 2000
    error = found.log_evidence_error
    assert found.log_evidence == pytest.approx(exact.log_evidence, abs=4.0 * error)
    xi = prior.to_normal(found.resampled(4000, 3).theta).numpy()
    sd = np.sqrt(np.diag(exact.covariance))
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.1)
    np.testing.assert_allclose(xi.std(0) / sd, 1.0, atol=0.08)


def test_a_factor_and_a_share_that_undo_each_other_keep_their_thin_ridge():
    """A factor over 1 + a share is seen to 1e-4: the share stays as wide as its prior."""
    factor = Parameter(name="theta_1", kind="stiffness", lower=0.5, upper=2.0)
    share = Parameter(name="mass", kind="effect", lower=-0.15, upper=0.15, neutral=0.0, scale=0.03)
    prior, noise = Parameters((factor, share)), 1e-4

    def residuals(values):
        return (values[:, :1] / (1.0 + values[:, 1:]) - 1.0) / noise

    def log_likelihood(values):
        return -0.5 * residuals(values).square().sum(1)

    about = found_from(prior, residuals, prior.from_normal(torch.zeros(1, 2).double()))
    found = draws_about(prior, log_likelihood, about, 4000, 1)
    assert found.effective > 2000
    # 1 + share has a mean of one; over the factor the likelihood is a needle in a box of 1.5.
    evidence = np.log(np.sqrt(2.0 * np.pi) * noise / 1.5)
    assert found.log_evidence == pytest.approx(evidence, abs=4.0 * found.log_evidence_error)
    drawn = found.resampled(4000, 2).theta.numpy()
    # 2,000 draws know a standard deviation to 1.6 %.
    np.testing.assert_allclose(drawn.std(0), 0.03, rtol=0.05)


def test_maxima_have_their_masses_whatever_their_heights():
    """xi_1^2 is seen to .002 about 1, xi_2 leans to the left one: evidence by hand."""
    prior, noise = box([0.0, 0.0], [1.0, 1.0]), 2e-3

    def residuals(theta):
        xi = prior.to_normal(theta)
        return torch.stack([(xi[:, 0].square() - 1.0) / noise, (xi[:, 1] - xi[:, 0]) / 0.5], 1)

    def log_likelihood(theta):
        return -0.5 * residuals(theta).square().sum(1)

    def by_hand(centre):
        """Over xi_1 the likelihood is a needle; over xi_2 a product of normal densities."""
        needle = noise / (2.0 * abs(centre)) * np.exp(-0.5 * centre**2)
        return needle * 0.5 * np.exp(-0.5 * centre**2 / 1.25) / np.sqrt(1.25)

    starts = prior.from_normal(torch.tensor([[-0.7, 0.3], [1.4, -0.2], [0.8, 0.0]]).double())
    found = draws_about(prior, log_likelihood, found_from(prior, residuals, starts), 6000, 0)
    assert found.log_evidence == pytest.approx(np.log(2.0 * by_hand(1.0)), abs=0.03)
    left = prior.to_normal(found.resampled(4000, 1).theta)[:, 0] < 0.0
    assert float(left.double().mean()) == pytest.approx(0.5, abs=0.03)


def test_draws_of_which_few_count_are_none():
    """Weights that scatter by a factor of e^4 from place to place, whatever the proposal."""
    prior = box([0.0] * 2, [1.0] * 2)
    found = found_from(
        prior, lambda t: 10.0 * (t - 0.5), prior.from_unit(torch.rand(1, 2).double())
    )

    def rough(theta):
        return 20.0 * torch.sin(1e6 * theta[:, 0]) - 50.0 * (theta - 0.5).square().sum(1)

    assert draws_about(prior, rough, found, 1000, 0) is None


@pytest.mark.parametrize(
    "theta",
    [
        (0.52, 0.34, 1.78, 1.49, 1.85, 2.15),
        (2.52, 0.76, 1.42, 2.78, 1.02, 1.04),
        (0.8, 1.61, 2.69, 1.31, 0.39, 2.92),
        (0.5, 2.88, 1.91, 2.73, 0.4, 1.86),
    ],
)
def test_the_highest_maximum_of_a_roof_is_found_from_the_prior(theta):
    """Peaks that do not meet hold a search beside it."""
    masses, springs = np.linspace(2e4, 1.5e4, 6), np.linspace(4e7, 2e7, 6)
    grid = 0.05 * np.arange(1, 601)
    exact = Chain(masses, springs * theta, zeta=0.02).frf(grid)[-1:]
    sd = np.full(exact.shape, 0.03)
    noise = 0.03 * np.random.default_rng(5).standard_normal(exact.shape)
    seen = Observation(grid, ("RF",), np.log(np.abs(exact)) + noise, sd, sd > 0.0)
    model, names = reduced_stick(masses, springs), [f"theta_{k}" for k in range(1, 7)]
    prior = Parameters.uniform(names, [1 / 3] * 6, [3.0] * 6)
    prior += Parameters.uniform(["zeta"], [0.005], [0.06], kind="damping")
    likelihood = likelihood_of((base_logs(seen, System(model)),), System(model), prior)
    found = settled(likelihood, 0)
    truth = torch.tensor([[*theta, 0.02]], dtype=torch.float64)
    best = prior.from_normal(found.found.z)
    # A maximum lies above the truth, by 3.5 nats in the mean.
    assert found.likelihood(best).max() > found.likelihood(truth) - 1.0


def test_about_a_maximum_a_model_needs_few_of_its_shapes():
    """What they change of the likelihood of a long chain, at draws that they were not made from."""
    whole = reduced_stick(np.full(60, 2e4), np.full(60, 4e8))
    halves = np.stack([whole.stiffness_terms[:30].sum(0), whole.stiffness_terms[30:].sum(0)])
    rows = {"floor_shapes": whole.floor_shapes[[29, 59]], "floors": ("31F", "RF")}
    system = System(replace(whole, stiffness_terms=halves, rotation=None, **rows))
    prior = Parameters.uniform(["theta_1", "theta_2"], [1 / 3] * 2, [3.0] * 2)
    prior += Parameters.uniform(["zeta"], [0.005], [0.06], kind="damping")
    truth, grid = torch.tensor([[0.8, 1.3, 0.02]]).double(), 0.05 * torch.arange(1, 301).double()
    frf = system.frf(truth[:, :2], truth[:, 2], truth[:, 3:], grid)[0].abs().log().numpy()
    sd = np.full(frf.shape, 0.01)
    noise = 0.01 * np.random.default_rng(7).standard_normal(frf.shape)
    seen = Observation(grid.numpy(), system.floors, frf + noise, sd, sd > 0.0)
    found = settled(likelihood_of((base_logs(seen, system),), system, prior), 0)
    few = on_fewer_shapes(found.likelihood, found.found, 1)
    assert few.system.model.size <= 40
    scale = torch.linalg.inv(found.found.precision[0]).diagonal().sqrt()
    normal = torch.randn(40, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    drawn = prior.from_normal(found.found.z[0] + 2.0 * scale * normal)
    # Twice as far as the posterior reaches; where shapes were chosen they err by .05 nats.
    np.testing.assert_allclose(few(drawn), found.likelihood(drawn), atol=0.3)


@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_linear_gaussian(shift):
    """Also from particles that lie three standard deviations off."""
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), LinearGaussian(*PROBLEM[:2], 0.3)
    sd = np.sqrt(np.diag(exact.covariance))
    start = prior.to_normal(exact.draws(prior, 1000, 0)) + shift * torch.from_numpy(sd)
    found = draws_about_particles(prior, exact.on(prior), prior.from_normal(start), 8000, 1)
    assert found.effective > 0.5 * 8000
    error = found.log_evidence_error
    assert error < 0.01
    assert found.log_evidence == pytest.approx(exact.log_evidence, abs=4.0 * error)
    xi = prior.to_normal(found.resampled(4000, 2).theta).numpy()
    # 1,000 independent draws at least: standard error .032 sd and 4.5 % of a variance.
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.12)
    np.testing.assert_allclose(xi.var(0) / sd**2, 1.0, atol=0.15)


def test_two_modes_keep_their_shares():
    """Gaussians of weights .8 and .2 at both ends of the box, from particles half and half."""
    prior = box([0.0, 0.0], [1.0, 1.0])
    centres = torch.tensor([[0.2, 0.3], [0.8, 0.6]], dtype=torch.float64)
    scale, share = torch.tensor([0.01, 0.02]), torch.tensor([0.8, 0.2])

    def log_likelihood(theta):
        squares = ((theta[:, None] - centres) ** 2).sum(-1) / scale**2
        return torch.logsumexp(share.log() - 2.0 * scale.log() - 0.5 * squares, dim=1)

    start = centres.repeat(400, 1)
    start = start + 0.01 * torch.randn(start.shape, generator=torch.Generator().manual_seed(0))
    found = draws_about_particles(prior, log_likelihood, start, 6000, 5)
    # The integral over the box of the two unnormalised Gaussians.
    assert found.log_evidence == pytest.approx(np.log(2.0 * np.pi), abs=0.03)
    drawn = found.resampled(3000, 0)
    assert float((drawn.theta[:, 0] < 0.5).double().mean()) == pytest.approx(0.8, abs=0.02)
    torch.testing.assert_close(drawn.log_likelihood, log_likelihood(drawn.theta))


WEIGHT = np.array([0.5, 0.2, 0.3])
MEAN = np.array([[0.0, 1.0], [4.0, -3.0], [-5.0, 0.5]])
COVARIANCE = np.array(
    [[[1.0, 0.6], [0.6, 0.8]], [[0.3, -0.1], [-0.1, 2.0]], [[0.05, 0.0], [0.0, 0.4]]]
)


def mixture(weight=WEIGHT, mean=MEAN, covariance=COVARIANCE):
    return Mixture(
        torch.from_numpy(weight).log(),
        torch.from_numpy(mean),
        torch.linalg.cholesky(torch.from_numpy(covariance)),
    )


def draws(count, seed=0):
    rng = np.random.default_rng(seed)
    which = rng.choice(3, size=count, p=WEIGHT)
    x = np.array([rng.multivariate_normal(MEAN[k], COVARIANCE[k]) for k in which])
    return torch.from_numpy(x)


def test_density_is_that_of_scipy():
    x = np.random.default_rng(1).normal(scale=4.0, size=(50, 2))
    parts = [
        np.log(w) + multivariate_normal(m, c).logpdf(x)
        for w, m, c in zip(WEIGHT, MEAN, COVARIANCE, strict=True)
    ]
    found = mixture().component_log_density(torch.from_numpy(x))
    np.testing.assert_allclose(found, np.stack(parts, axis=1), rtol=1e-12)
    np.testing.assert_allclose(
        mixture().log_density(torch.from_numpy(x)), logsumexp(parts, axis=0), rtol=1e-12
    )


def test_a_known_mixture_is_recovered():
    x = draws(6000)
    found = fit_mixture(x, 3, torch.Generator().manual_seed(0))
    order = np.argsort(found.mean[:, 0].numpy())
    expected = np.argsort(MEAN[:, 0])
    # 1200 draws of the smallest component: standard errors of .01, .04 and 6 %.
    np.testing.assert_allclose(found.log_weight.exp()[order], WEIGHT[expected], atol=0.02)
    np.testing.assert_allclose(found.mean[order], MEAN[expected], atol=0.12)
    covariance = (found.cholesky @ found.cholesky.transpose(1, 2))[order]
    np.testing.assert_allclose(covariance, COVARIANCE[expected], atol=0.2)
    # No worse, on its own data, than the mixture they came from.
    assert float(found.log_density(x).mean()) >= float(mixture().log_density(x).mean()) - 1e-3
