"""The terms of the loss against torch's distributions, and what minimises them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn
from torch.distributions import Independent, Normal, kl_divergence

from femupdate.surrogate import loss as room
from femupdate.surrogate.loss import (
    LossSettings,
    divergence,
    local_contrast,
    loss_terms,
    prior_divergence,
)
from femupdate.surrogate.network import LatentGaussian, Mvae, NetworkSizes, Visibility

SIZES = NetworkSizes(2, 30, 2, latent=3, floor_features=6, width=16, parameter_width=12, blocks=2)


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def gaussian(seed, shape=(7, 3)):
    draw = generator(seed)
    mean = torch.randn(shape, generator=draw, dtype=torch.float64)
    return LatentGaussian(mean, torch.rand(shape, generator=draw, dtype=torch.float64))


def distribution(q):
    return Independent(Normal(q.mean, q.variance.sqrt()), 1)


def test_divergences_are_those_of_torch():
    q, p = gaussian(0), gaussian(1)
    standard = Independent(Normal(torch.zeros_like(q.mean), torch.ones_like(q.mean)), 1)
    torch.testing.assert_close(
        prior_divergence(q), kl_divergence(distribution(q), standard), rtol=1e-10, atol=1e-10
    )
    expected = kl_divergence(distribution(q), distribution(p))
    torch.testing.assert_close(divergence(q, p), expected, rtol=1e-10, atol=1e-10)
    assert float(divergence(q, q).abs().max()) < 1e-12


@pytest.fixture(scope="module")
def mvae():
    torch.manual_seed(0)
    networks = Mvae(SIZES).double()
    networks.lower.copy_(torch.tensor([0.3, 0.5]))
    networks.upper.copy_(torch.tensor([3.0, 2.0]))
    networks.x_mean.normal_()
    networks.x_scale.uniform_(0.5, 2.0)
    for parameter in networks.parameters():
        nn.init.normal_(parameter, std=0.3)
    return networks.requires_grad_(False)


@pytest.fixture(scope="module")
def batch():
    x = torch.randn(6, 2, 30, generator=generator(5), dtype=torch.float64)
    floors = torch.tensor([[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]], dtype=torch.float64).repeat(2, 1)
    band = torch.tensor([[0.0, 1.0], [0.1, 0.6], [0.0, 0.3]], dtype=torch.float64).repeat(2, 1)
    return x, Visibility(floors, band)


def certain(seed, rows=6):
    """Posteriors without width: every draw is the mean."""
    mean = torch.randn(rows, 3, generator=generator(seed), dtype=torch.float64)
    return LatentGaussian(mean, torch.zeros_like(mean))


def expected_nats(mvae, z, target, visibility, noise_sd):
    """-ln p(target | z) summed over what is observed (B,), by torch's distributions."""
    mean, log_excess = mvae.decoder(z)
    spread = (noise_sd**2 + mvae.x_scale**2 * log_excess.exp()).sqrt()
    density = Normal(mvae.x_mean + mvae.x_scale * mean, spread)
    return -(density.log_prob(target) * visibility.weights(30)).sum((1, 2))


def reconstruct(mvae, pair, x, visibility, settings, seed):
    return float(room._reconstruction(mvae, pair, x, visibility, settings, generator(seed)))


def test_expectation_over_the_noise_of_the_target_is_that_of_draws(mvae, batch):
    x, visibility = batch
    settings = LossSettings(noise_sd=0.3, points=30)
    pair = certain(1), certain(2)
    found = reconstruct(mvae, pair, x, visibility, settings, 0)
    draw, sums = generator(9), []
    for _ in range(800):
        target = x + 0.3 * torch.randn(x.shape, generator=draw, dtype=torch.float64)
        nats = sum(expected_nats(mvae, q.mean, target, visibility, 0.3) for q in pair)
        sums.append(float(nats.mean()))
    error = np.std(sums) / len(sums) ** 0.5
    assert error < 2e-3 * abs(found)
    assert found == pytest.approx(np.mean(sums), abs=4 * error)


def test_a_subset_of_frequencies_is_an_unbiased_estimate(mvae, batch):
    x, visibility = batch
    settings = LossSettings(noise_sd=0.3, points=30)
    pair = certain(1), certain(2)
    full = reconstruct(mvae, pair, x, visibility, settings, 0)
    some = [
        reconstruct(mvae, pair, x, visibility, replace(settings, points=7), seed)
        for seed in range(1500)
    ]
    error = np.std(some) / len(some) ** 0.5
    assert 0.0 < error < 0.02 * abs(full)
    assert np.mean(some) == pytest.approx(full, abs=4 * error)
    # More points than there are is all of them, whatever the draw.
    many = reconstruct(mvae, pair, x, visibility, replace(settings, points=99), 3)
    assert many == pytest.approx(full, rel=1e-12)


def test_draws_of_z_have_the_width_of_their_posterior(mvae, batch):
    """Mean over draws against Gauss-Hermite quadrature along one coordinate of z."""
    x, visibility = batch
    settings = LossSettings(noise_sd=0.3, points=30)
    wide = certain(1)
    wide = LatentGaussian(wide.mean, wide.variance.clone())
    wide.variance[:, 1] = 0.4
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    expected = 0.0
    for node, weight in zip(nodes, weights / weights.sum(), strict=True):
        shifted = LatentGaussian(wide.mean.clone(), torch.zeros_like(wide.variance))
        shifted.mean[:, 1] += 0.4**0.5 * node
        expected += weight * reconstruct(mvae, (shifted, shifted), x, visibility, settings, 0)
    found = [reconstruct(mvae, (wide, wide), x, visibility, settings, k) for k in range(400)]
    error = np.std(found) / len(found) ** 0.5
    assert error < 0.01 * abs(expected)
    assert np.mean(found) == pytest.approx(expected, abs=4 * error)


def test_what_is_not_observed_does_not_count(mvae, batch):
    x, visibility = batch
    theta = torch.full((6, 2), 1.2, dtype=torch.float64)
    other = torch.where(visibility.weights(30) > 0, x, 50.0)
    one, two = (
        loss_terms(mvae, values, theta, visibility, LossSettings(contrast_rows=6), generator(3))
        for values in (x, other)
    )
    assert vars(one).keys() == vars(two).keys()
    for name, value in vars(one).items():
        torch.testing.assert_close(value, vars(two)[name], rtol=1e-10, atol=1e-10)


def test_the_total_weighs_the_terms_as_it_says(mvae, batch):
    x, visibility = batch
    theta = torch.full((6, 2), 1.2, dtype=torch.float64)
    settings = LossSettings(coupling=1.5, reconstruction=8.0, contrast=0.25, contrast_rows=4)
    terms = loss_terms(mvae, x, theta, visibility, settings, generator(3))
    by_hand = (
        terms.reconstruction
        + (terms.prior_divergence + 1.5 * terms.coupling) / 8.0
        + 0.25 * terms.contrast
    )
    assert float(terms.total(settings)) == pytest.approx(float(by_hand), rel=1e-12)
    q_theta = mvae.encode_parameters(theta, visibility)
    assert float(terms.prior_divergence) > float(prior_divergence(q_theta).mean()) > 0.0
    without = loss_terms(mvae, x, theta, visibility, replace(settings, contrast=0.0), generator(3))
    assert float(without.contrast) == 0.0
    assert float(without.reconstruction) == float(terms.reconstruction)


def test_the_same_generator_gives_the_same_loss(mvae, batch):
    x, visibility = batch
    theta = torch.full((6, 2), 1.2, dtype=torch.float64)
    torch.manual_seed(0)
    before = torch.random.get_rng_state()
    one = loss_terms(mvae, x, theta, visibility, LossSettings(), generator(3))
    assert torch.equal(torch.random.get_rng_state(), before)
    two = loss_terms(mvae, x, theta, visibility, LossSettings(), generator(3))
    other = loss_terms(mvae, x, theta, visibility, LossSettings(), generator(4))
    assert float(one.total(LossSettings())) == float(two.total(LossSettings()))
    assert float(one.total(LossSettings())) != float(other.total(LossSettings()))


class LinearEncoder(nn.Module):
    """Networks reduced to what local_contrast asks of them: z is theta in the unit box."""

    def __init__(self, variance, shift, size):
        super().__init__()
        self.variance, self.shift = variance, shift
        self.register_buffer("lower", torch.full((size,), 2.0, dtype=torch.float64))
        self.register_buffer("upper", torch.full((size,), 5.0, dtype=torch.float64))

    def encode_parameters(self, theta, visibility):
        unit = (theta - self.lower) / (self.upper - self.lower)
        return LatentGaussian(unit + self.shift, self.variance.expand_as(unit))


def contrast(width, shift=0.0, sd=0.02, size=2, rows=8000):
    """Cross-entropy where the exact posterior is N(x, sd^2) and the latent one is so much wider."""
    draw = generator(1)
    unit = torch.rand(rows, size, generator=draw, dtype=torch.float64)
    x = unit + sd * torch.randn(rows, size, generator=draw, dtype=torch.float64)
    half = torch.tensor(0.5 * (width * sd) ** 2, dtype=torch.float64)
    mvae = LinearEncoder(half, shift * sd, size)
    theta = mvae.lower + (mvae.upper - mvae.lower) * unit
    visibility = Visibility(torch.ones(rows, 1), torch.tensor([[0.0, 1.0]]).expand(rows, 2))
    q_x = LatentGaussian(x, half.expand_as(x))
    q_theta = mvae.encode_parameters(theta, visibility)
    settings = LossSettings(contrast_rows=rows, alternatives=8)
    return float(local_contrast(mvae, q_x, q_theta, theta, visibility, settings, generator(2)))


@pytest.mark.parametrize("size", [1, 2, 4])
def test_the_true_posterior_minimises_the_local_contrast(size):
    log_widths = np.linspace(-0.5, 0.5, 9)
    scores = [contrast(np.exp(one), size=size) for one in log_widths]
    cubic = np.polyfit(log_widths, scores, 3)
    fine = np.linspace(-0.4, 0.4, 801)
    # Four seeds of this size give widths of .97 to 1.02. Alternatives around the true theta
    # itself, and not around a hidden centre, would give 1.06 to 1.11.
    assert np.exp(fine[np.polyval(cubic, fine).argmin()]) == pytest.approx(1.0, abs=0.04)


def test_the_contrast_grows_to_both_sides():
    scores = [contrast(width) for width in (0.2, 0.4, 0.7, 1.0, 1.5, 3.0, 6.0)]
    assert (np.diff(scores[:4]) < 0).all()
    assert (np.diff(scores[3:]) > 0).all()


def test_a_shifted_posterior_scores_worse():
    scores = [contrast(1.0, shift) for shift in (-1.0, -0.3, 0.0, 0.3, 1.0)]
    assert int(np.argmin(scores)) == 2
    assert scores[0] > scores[1] + 0.02
    assert scores[4] > scores[3] + 0.02


def test_contrast_is_between_certainty_and_a_guess():
    """The more the data say, the less is left to guess among nine."""
    scores = [contrast(1.0, sd=sd) for sd in (1e-4, 0.02, 0.9)]
    assert 0.0 <= scores[0] < 0.15
    assert scores == sorted(scores)
    # Without data all nine are equal, but for those that fall outside the box.
    assert np.log(3.0) < scores[2] < np.log(9.0)


class LinearNetworks(nn.Module):
    """A linear-Gaussian autoencoder: x = h theta + noise seen by linear encoders and decoder."""

    def __init__(self, h):
        super().__init__()
        self.to_z = nn.Parameter(h / (h @ h))
        self.from_theta = nn.Parameter(torch.ones(1, dtype=h.dtype))
        self.log_variance_x = nn.Parameter(torch.tensor(-4.0, dtype=h.dtype))
        self.log_variance_theta = nn.Parameter(torch.tensor(-4.0, dtype=h.dtype))
        self.to_x = nn.Parameter(h.clone())
        self.log_excess = nn.Parameter(torch.full((1, len(h)), -8.0, dtype=h.dtype))
        self.register_buffer("x_mean", torch.zeros(1, len(h), dtype=h.dtype))
        self.register_buffer("x_scale", torch.ones(1, len(h), dtype=h.dtype))

    def encode_observation(self, x, visibility):
        mean = (x @ self.to_z).reshape(-1, 1)
        return LatentGaussian(mean, self.log_variance_x.exp().expand_as(mean))

    def encode_parameters(self, theta, visibility):
        mean = theta * self.from_theta
        return LatentGaussian(mean, self.log_variance_theta.exp().expand_as(mean))

    def decoder(self, z, points):
        return (z * self.to_x[points])[:, None], self.log_excess[:, points]


@pytest.mark.parametrize(
    ("coupling", "reconstruction", "share"),
    [(0.0, 2.0, 0.5), (1.0, 6.0, 0.5), (5.0, 22.0, 0.5), (0.0, 1.0, 1.0), (1.0, 2.0, 1.0)],
)
def test_the_calibration_law(coupling, reconstruction, share):
    """w = 2 + 4 alpha gives each encoder half of the exact variance; w = 1 alone doubles it.

    In general w u^2 - u - alpha = 0 for the share u of the exact variance.
    """
    count, points, noise = 4000, 60, 0.5
    h = torch.linspace(0.4, 1.6, points, dtype=torch.float64)
    exact = noise**2 / float(h @ h)  # 0.0034 of a prior variance of one
    assert reconstruction * share**2 - share - coupling == pytest.approx(0.0)
    theta = torch.randn(count, 1, generator=generator(7), dtype=torch.float64)
    x = (theta * h)[:, None]
    visibility = Visibility(torch.ones(count, 1), torch.tensor([[0.0, 1.0]]).expand(count, 2))
    settings = LossSettings(noise, coupling, reconstruction, contrast=0.0, points=points)
    networks = LinearNetworks(h)
    optimizer = torch.optim.LBFGS(
        networks.parameters(), max_iter=80, line_search_fn="strong_wolfe", tolerance_change=1e-12
    )

    def closure():
        optimizer.zero_grad()
        # The same draws every time: the mean over the sample is minimised, exactly.
        value = loss_terms(networks, x, theta, visibility, settings, generator(11)).total(settings)
        value.backward()
        return value

    optimizer.step(closure)
    scale = float(networks.from_theta.detach()) ** 2  # z may stretch a little
    for log_variance in (networks.log_variance_x, networks.log_variance_theta):
        # 4000 draws of z give a variance to 2.2 %.
        assert float(log_variance.detach().exp()) / scale == pytest.approx(share * exact, rel=0.07)
