"""The networks: what they see, what they must not see, and their shapes."""

import numpy as np
import pytest
import torch

from femupdate.surrogate.network import (
    GaussianHead,
    LatentGaussian,
    Mvae,
    NetworkSizes,
    Visibility,
    parameter_features,
)

SIZES = NetworkSizes(3, 40, 2, latent=5, floor_features=6, width=16, parameter_width=12, blocks=2)


@pytest.fixture
def mvae():
    torch.manual_seed(0)
    networks = Mvae(SIZES)
    networks.lower.copy_(torch.tensor([0.3, 0.5]))
    networks.upper.copy_(torch.tensor([3.0, 2.0]))
    networks.x_mean.normal_()
    networks.x_scale.uniform_(0.5, 2.0)
    for parameter in networks.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return networks


def seen(floors, band=(0.0, 1.0)):
    return Visibility(torch.tensor([floors]), torch.tensor([band]))


def test_points_that_count_by_hand():
    visibility = Visibility(
        torch.tensor([[1.0, 0.0], [0.0, 1.0]]), torch.tensor([[0.0, 1.0], [0.25, 0.5]])
    )
    weights = visibility.weights(5)
    assert weights[0].tolist() == [[1.0] * 5, [0.0] * 5]
    assert weights[1].tolist() == [[0.0] * 5, [0.0, 1.0, 1.0, 0.0, 0.0]]
    chosen = torch.tensor([4, 1])
    assert torch.equal(visibility.weights(5, chosen), weights[..., chosen])


@pytest.mark.parametrize("points", [2, 64, 1024])
def test_every_band_of_whole_points_is_exact(points):
    """Shares of the grid in single precision still say which points are inside."""
    first = torch.randint(0, points, (200,))
    last = torch.minimum(first + torch.randint(0, points, (200,)), torch.tensor(points - 1))
    band = torch.stack([first, last], dim=1) / (points - 1)
    weights = Visibility(torch.ones(200, 1), band.float()).weights(points)[:, 0]
    index = torch.arange(points)
    expected = (index >= first[:, None]) & (index <= last[:, None])
    assert torch.equal(weights.bool(), expected)


def test_rows_are_repeated_and_expanded():
    two = Visibility(torch.tensor([[1.0, 0.0], [0.0, 1.0]]), torch.tensor([[0.0, 1.0], [0.1, 0.9]]))
    assert len(two) == 2
    assert two.repeat(3).floors[:, 0].tolist() == [1.0] * 3 + [0.0] * 3
    assert two[1:].expand(4).band[:, 1].tolist() == pytest.approx([0.9] * 4)
    assert two.features().tolist()[1] == pytest.approx([0.0, 1.0, -0.8, 0.8])


def test_only_what_is_observed_reaches_the_observation_encoder(mvae):
    x = torch.randn(1, 3, 40)
    visibility = seen([1.0, 0.0, 1.0], (10 / 39, 30 / 39))
    other = x.clone()
    other[:, 1] = 1e3
    other[:, :, :10] = -1e3
    other[:, :, 31:] = 7.0
    one, two = (mvae.encode_observation(values, visibility) for values in (x, other))
    assert torch.equal(one.mean, two.mean)
    assert torch.equal(one.variance, two.variance)
    other[0, 2, 20] += 0.1
    assert not torch.equal(mvae.encode_observation(other, visibility).mean, one.mean)


def test_both_encoders_are_told_what_is_observed(mvae):
    theta = torch.tensor([[1.0, 1.0]])
    one = mvae.encode_parameters(theta, seen([1.0, 1.0, 1.0]))
    two = mvae.encode_parameters(theta, seen([0.0, 0.0, 1.0]))
    three = mvae.encode_parameters(theta, seen([1.0, 1.0, 1.0], (0.0, 0.5)))
    assert not torch.equal(one.mean, two.mean)
    assert not torch.equal(one.mean, three.mean)


def test_floors_have_linear_maps_of_their_own(mvae):
    layer = mvae.decoder.floors
    x = torch.randn(4, 3, 6)
    expected = torch.stack([x[:, k] @ layer.weight[k] + layer.bias[k] for k in range(3)], dim=1)
    torch.testing.assert_close(layer(x), expected)
    chosen = torch.tensor([39, 0, 7])
    torch.testing.assert_close(layer(x, chosen), expected[..., chosen])


def test_some_points_of_the_decoder_are_those_of_all(mvae):
    z, chosen = torch.randn(4, 5), torch.tensor([31, 2, 17])
    mean, excess = mvae.decoder(z)
    some, some_excess = mvae.decoder(z, chosen)
    assert mean.shape == (4, 3, 40)
    torch.testing.assert_close(some, mean[..., chosen])
    torch.testing.assert_close(some_excess, excess[:, chosen])


def test_features_of_theta_by_hand():
    lower, upper = torch.tensor([0.5, 0.1]), torch.tensor([2.0, 10.0])
    theta = torch.tensor([[0.5, 10.0], [1.0, 1.0], [2.0, 0.1]])
    found = parameter_features(theta, lower, upper)
    linear = [[-1.0, 1.0], [-1 / 3, 1.8 / 9.9 - 1.0], [1.0, -1.0]]
    logarithmic = [[-1.0, 1.0], [0.0, 0.0], [1.0, -1.0]]
    np.testing.assert_allclose(found[:, :2], linear, atol=1e-6)
    np.testing.assert_allclose(found[:, 2:], logarithmic, atol=1e-6)


def test_variances_lie_between_rounding_and_the_prior():
    head = GaussianHead(8, 3).requires_grad_(False)
    for parameter in head.parameters():
        torch.nn.init.normal_(parameter, std=100.0)
    q = head(100.0 * torch.randn(500, 8))
    assert float(q.variance.min()) > 1e-8
    assert float(q.variance.max()) <= 1.0
    assert float(q.variance.max()) > 0.99
    assert bool(torch.isfinite(q.variance.log()).all())


def test_draws_have_the_mean_and_the_variance():
    q = LatentGaussian(torch.tensor([[1.0, -2.0]]), torch.tensor([[0.25, 0.01]]))
    noise = torch.tensor([[2.0, -1.0]])
    assert q.sample(noise).tolist() == [pytest.approx([2.0, -2.1])]


def test_untrained_blocks_pass_everything_on():
    """The second layer of a block starts at zero: deep networks start as shallow ones."""
    torch.manual_seed(0)
    blocks = Mvae(SIZES).parameter_encoder.blocks
    x = torch.randn(3, 12)
    assert torch.equal(blocks(x), x)
