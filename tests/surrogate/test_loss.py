"""The terms of the loss against torch's distributions, and what minimises them."""

import numpy as np
import pytest
import torch
from torch.distributions import Normal

from femupdate.surrogate import (
    Mvae,
    NetworkSizes,
    TrainingSettings,
    Visibility,
    proposal,
    reconstruction,
)
from tests.surrogate.test_network import random_networks

SIZES = NetworkSizes(
    2, 30, 2, True, 3, floor_features=6, width=16, parameter_width=12, blocks=2, components=2
)


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def mvae():
    networks = random_networks(SIZES)
    networks.decoder.damping_bounds.copy_(torch.tensor([0.01, 0.05]))
    return networks.requires_grad_(False)


@pytest.fixture(scope="module")
def batch():
    x = torch.randn(6, 2, 30, generator=generator(5))
    floors = torch.tensor([[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]]).repeat(2, 1)
    band = torch.tensor([[0.0, 1.0], [0.1, 0.6], [0.0, 0.3]]).repeat(2, 1)
    return x, Visibility(floors, band)


def test_expectation_over_the_noise_of_the_target_is_that_of_draws(mvae, batch):
    x, _ = batch
    z = torch.randn(6, 3, generator=generator(1))
    settings = TrainingSettings(noise_sd=0.3, points=30)
    found = float(reconstruction(mvae, z, x, settings, generator()))
    spread = (0.09 + mvae.decoder.excess_variance()).sqrt()
    density = Normal(mvae.decode(z), spread)
    draw, sums = generator(9), []
    for _ in range(800):
        target = x + 0.3 * torch.randn(x.shape, generator=draw)
        sums.append(-float(density.log_prob(target).sum() / 6))
    error = np.std(sums) / len(sums) ** 0.5
    assert error < 2e-3 * abs(found)
    assert found == pytest.approx(np.mean(sums), abs=4 * error)


def test_what_is_not_observed_does_not_reach_the_proposal(mvae, batch):
    x, visibility = batch
    z = torch.randn(6, 3, generator=generator(1))
    other = torch.where(visibility.weights(30) > 0, x, 50.0)
    one, two = (
        float(proposal(mvae, z, values, visibility, TrainingSettings(), generator(3)))
        for values in (x, other)
    )
    assert one == pytest.approx(two, rel=1e-5)


def test_the_proposal_teaches_the_observation_encoder_alone(batch):
    torch.manual_seed(0)
    networks = Mvae(SIZES)
    networks.upper.fill_(3.0)
    networks.lower.fill_(0.5)
    networks.decoder.damping_bounds.copy_(torch.tensor([0.01, 0.05]))
    x, visibility = batch
    z = torch.randn(6, 3, generator=generator(1))
    proposal(networks, z, x, visibility, TrainingSettings(), generator(3)).backward()
    others = [*networks.bend.parameters(), *networks.decoder.parameters()]
    assert all(value.grad is None for value in others)
    moved = [value.grad for value in networks.observation_encoder.parameters()]
    assert all(value is not None and bool(value.abs().sum() > 0) for value in moved[:2])
