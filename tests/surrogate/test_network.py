"""The networks: what they see, what they must not see, and their shapes."""

import pytest
import torch

from femupdate.surrogate import Mvae, NetworkSizes, Visibility

SIZES = NetworkSizes(
    3, 40, 2, True, 4, floor_features=6, width=16, parameter_width=12, blocks=2, components=3
)


def random_networks(sizes):
    torch.manual_seed(0)
    networks = Mvae(sizes)
    networks.lower.copy_(torch.tensor([0.3, 0.5]))
    networks.upper.copy_(torch.tensor([3.0, 2.0]))
    networks.x_mean.normal_()
    networks.x_scale.uniform_(0.5, 2.0)
    for parameter in networks.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return networks


@pytest.fixture
def mvae():
    return random_networks(SIZES)


def seen(floors, band=(0.0, 1.0)):
    return Visibility(torch.tensor([floors]), torch.tensor([band]))


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


def test_only_what_is_observed_reaches_the_observation_encoder(mvae):
    x = torch.randn(1, 3, 40)
    visibility = seen([1.0, 0.0, 1.0], (10 / 39, 30 / 39))
    other = x.clone()
    other[:, 1] = 1e3
    other[:, :, :10] = -1e3
    other[:, :, 31:] = 7.0
    one, two = (mvae.encode_observation(values, visibility) for values in (x, other))
    assert torch.equal(one.mean, two.mean)
    assert torch.equal(one.log_weight, two.log_weight)
    other[0, 2, 20] += 0.1
    assert not torch.equal(mvae.encode_observation(other, visibility).mean, one.mean)


def test_the_observation_encoder_is_told_what_is_observed(mvae):
    x = mvae.x_mean[None]
    one = mvae.encode_observation(x, seen([1.0, 1.0, 1.0]))
    two = mvae.encode_observation(x, seen([0.0, 0.0, 1.0]))
    three = mvae.encode_observation(x, seen([1.0, 1.0, 1.0], (0.0, 0.5)))
    assert not torch.equal(one.mean, two.mean)
    assert not torch.equal(one.mean, three.mean)


def test_parameters_are_found_again_from_where_they_are_put(mvae):
    theta = mvae.lower + (mvae.upper - mvae.lower) * torch.rand(50, 2)
    z = torch.nn.functional.pad(mvae.encode_parameters(theta), (0, 1), value=0.3)
    torch.testing.assert_close(mvae.parameters_at(z), theta)
    beyond = mvae.parameters_at(torch.full((1, 3), 50.0))
    assert bool((beyond > mvae.upper).all())
    assert bool((beyond < 1.5 * mvae.upper).all())
    assert bool((mvae.parameters_at(torch.full((1, 3), -50.0)) > 0.3 * mvae.lower).all())
