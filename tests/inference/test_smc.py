"""The sampler against posteriors and evidences in closed form, none of them symmetric."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from femupdate.inference import SmcSettings, TemperedSmc
from femupdate.inference.importance import (
    effective_sample_size,
    next_increment,
    students,
    systematic_rows,
)
from femupdate.inference.smc import Hamiltonian
from tests.inference.gaussians import LinearGaussian, box

THOROUGH = SmcSettings(ess_target=0.8, unmoved=0.0)
WALK = replace(THOROUGH, independence_moves=0, walk_scale=0.5, moves=15)
MIXTURE = replace(THOROUGH, independence_moves=10)
PROBLEM = (
    np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]]),
    np.array([1.3, -0.8, 2.1, 0.4]),
    0.3,
)


@pytest.mark.parametrize(
    "settings",
    [SmcSettings(), THOROUGH, WALK, MIXTURE],
    ids=["default", "thorough", "walk", "mixture"],
)
def test_linear_gaussian_posterior_and_evidence(settings):
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), LinearGaussian(*PROBLEM)
    result = TemperedSmc(prior, exact.on(prior), settings=settings).run(2000, 1)
    xi = prior.to_normal(result.theta).numpy()
    sd = np.sqrt(np.diag(exact.covariance))
    # 2000 independent draws have standard errors of .022 sd and 3 % of a variance. Over twenty
    # seeds the largest of three was off by up to .07 and .15, the log evidence by .045 (sd).
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.1)
    ratio = np.linalg.solve(exact.covariance, np.cov(xi.T))
    np.testing.assert_allclose(ratio, np.eye(3), atol=0.2)
    assert result.log_evidence == pytest.approx(exact.log_evidence, abs=0.18)
    # The proposals' tails reach where a draw is the box's very bound, and this likelihood infinite.
    assert result.invalid < 1e-3 * result.evaluations
    most = 2000 * (1 + settings.moves * result.levels)
    if settings.unmoved == 0.0:
        assert result.evaluations == most
    else:
        assert result.evaluations < 0.6 * most
    np.testing.assert_allclose(
        result.log_likelihood, exact.on(prior)(result.theta), rtol=1e-9, atol=1e-9
    )


def test_half_space_of_a_box():
    """1 where theta_1 + 2 theta_2 < 1.5, else impossible: the evidence is an area."""
    prior = box([0.0, 0.0], [1.0, 3.0])

    def inside(theta):
        return torch.where(theta[:, 0] + 2.0 * theta[:, 1] < 1.5, 0.0, -torch.inf)

    result = TemperedSmc(prior, inside).run(3000, 5)
    area = (0.75 + 0.25) / 2.0
    # Binomial: sd of ln is ((1 - p) / (p n))^.5 = .041; the moves add nothing.
    assert result.log_evidence == pytest.approx(np.log(area / 3.0), abs=4 * 0.041)
    assert bool((inside(result.theta) == 0.0).all())
    assert result.theta[:, 0].mean() == pytest.approx(5.0 / 12.0, abs=0.04)
    assert result.theta[:, 1].mean() == pytest.approx((1.5**3 - 0.5**3) / 24.0 / 0.5, abs=0.03)
    assert result.invalid > 1000


@pytest.mark.parametrize("wrong", [torch.nan, torch.inf, -torch.inf])
def test_points_without_a_number_are_counted_and_never_rewarded(wrong):
    prior = box([0.0, 0.0], [1.0, 1.0])

    def log_likelihood(theta):
        value = -3.0 * theta[:, 0]
        return torch.where(theta[:, 0] + theta[:, 1] > 0.8, wrong, value)

    result = TemperedSmc(prior, log_likelihood).run(2000, 0)
    assert bool((result.theta.sum(1) <= 0.8).all())
    assert bool(torch.isfinite(result.log_likelihood).all())
    assert 0 < result.invalid < result.evaluations
    # The integral of exp(-3 x) (.8 - x) over x from 0 to .8.
    exact = 0.8 / 3.0 + np.expm1(-2.4) / 9.0
    assert result.log_evidence == pytest.approx(np.log(exact), abs=0.2)


def test_a_seed_gives_one_answer_and_leaves_the_global_generator_alone():
    prior, exact = box([0.0] * 3, [1.0] * 3), LinearGaussian(*PROBLEM)
    sampler = TemperedSmc(prior, exact.on(prior))
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    one = sampler.run(300, 11)
    assert torch.equal(torch.random.get_rng_state(), before)
    torch.manual_seed(6)
    assert torch.equal(sampler.run(300, 11).theta, one.theta)
    assert not torch.equal(sampler.run(300, 12).theta, one.theta)


def test_four_narrow_modes_keep_their_weights():
    """Unequal Gaussians in the box; the weights of the modes are their integrals."""
    weight = np.array([0.34, 0.13, 0.35, 0.18])
    centre = np.array([[1.0, 1.0], [1.7, 0.6], [2.0, 2.6], [2.7, 0.9]])
    sd = np.array([[0.01, 0.02], [0.007, 0.012], [0.03, 0.006], [0.012, 0.01]])
    prior = box([0.33, 0.33], [3.0, 3.0])

    def log_likelihood(theta):
        z = (theta[:, None] - torch.from_numpy(centre)) / torch.from_numpy(sd)
        constant = torch.from_numpy(np.log(weight) - np.log(sd).sum(1) - np.log(2.0 * np.pi))
        return torch.logsumexp(constant - 0.5 * (z**2).sum(-1), dim=1)

    result = TemperedSmc(prior, log_likelihood).run(2000, 0)
    theta = result.theta.numpy()
    mode = np.abs((theta[:, None] - centre) / sd).max(-1).argmin(1)
    share = np.bincount(mode, minlength=4) / 2000
    # Binomial errors of 2000 draws are .008 to .011, and so were the spreads over twenty seeds;
    # that of the log evidence was .03.
    np.testing.assert_allclose(share, weight, atol=4 * 0.011)
    assert result.log_evidence == pytest.approx(np.log(1.0 / 2.67**2), abs=0.15)
    for k in range(4):
        inside = theta[mode == k]
        np.testing.assert_allclose(inside.std(0), sd[k], rtol=0.2)
        np.testing.assert_allclose(inside.mean(0), centre[k], atol=5 * sd[k].max() / 15)


gains = st.lists(st.one_of(st.floats(-1e4, 1e4), st.just(-np.inf)), min_size=2, max_size=60).filter(
    lambda values: max(values) > -np.inf
)


def test_effective_sample_size_by_hand():
    weight = torch.tensor([0.5, 0.25, 0.25, 0.0], dtype=torch.float64)
    assert effective_sample_size(weight.log() + 700.0) == pytest.approx(1.0 / 0.375, rel=1e-12)
    assert effective_sample_size(torch.zeros(17)) == pytest.approx(17.0)
    assert effective_sample_size(torch.tensor([0.0, -torch.inf, -torch.inf])) == pytest.approx(1.0)


@settings(deadline=None)
@given(values=gains, most=st.floats(1e-6, 1.0), share=st.floats(0.1, 0.95))
def test_the_increment_keeps_the_effective_size_it_promises(values, most, share):
    gain = torch.tensor(values, dtype=torch.float64)
    step = next_increment(gain, most, share)
    assert 0.0 < step <= max(most, 1e-12)
    possible = int(torch.isfinite(gain).sum())
    if step > 1e-12:
        assert effective_sample_size(step * gain) >= share * len(gain) * (1.0 - 1e-9)
    else:  # even the smallest step loses too many: they were impossible from the start
        assert effective_sample_size(1e-11 * gain) < share * len(gain)
    # It is the largest such step, to a thousandth.
    assume(step < most)
    assert effective_sample_size(1.002 * step * gain) < share * len(gain) * (1.0 + 1e-9)
    assert possible >= 1


weights = st.lists(st.one_of(st.just(0.0), st.floats(1e-6, 1.0)), min_size=1, max_size=40).filter(
    lambda values: sum(values) > 0
)


@settings(deadline=None)
@given(values=weights, seed=st.integers(0, 2**31))
def test_every_row_comes_floor_or_ceil_of_its_share(values, seed):
    weight = torch.tensor(values, dtype=torch.float64)
    weight = weight / weight.sum()
    rows = systematic_rows(weight, torch.Generator().manual_seed(seed))
    assert len(rows) == len(weight)
    counts = np.bincount(rows.numpy(), minlength=len(weight))
    share = len(weight) * weight.numpy()
    assert (counts >= np.floor(share - 1e-9)).all()
    assert (counts <= np.ceil(share + 1e-9)).all()
    assert (counts[weight.numpy() == 0.0] == 0).all()
    assert (np.diff(rows.numpy()) >= 0).all()


def test_resampling_is_unbiased():
    weight = torch.tensor([0.03, 0.4, 0.0, 0.22, 0.35], dtype=torch.float64)
    generator, tries = torch.Generator().manual_seed(4), 4000
    rows = torch.cat([systematic_rows(weight, generator) for _ in range(tries)])
    mean = np.bincount(rows.numpy(), minlength=5) / tries
    # A count of floor or ceil has a variance of at most 1/4: five standard errors.
    np.testing.assert_allclose(mean, 5.0 * weight, atol=5.0 * 0.5 / tries**0.5)


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
