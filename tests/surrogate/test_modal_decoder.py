"""The decoder: the same superposition as everywhere, from modes that it starts at the mean of."""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.modal_frf import log_frf

from femupdate.dynamics import ConstantDamping, ModalData
from femupdate.surrogate import ModalDecoder, NetworkSizes

SIZES = NetworkSizes(3, 40, 2, True, 2, width=16, decoder_width=16, blocks=2)
TOP = 2.0 * np.pi * 20.0


@pytest.fixture
def modes():
    generator = torch.Generator().manual_seed(1)
    omega = torch.tensor([20.0, 70.0]) * (1.0 + 0.1 * torch.rand(50, 2, generator=generator))
    effect = torch.randn(50, 3, 2, generator=generator)
    series = 1e-5 * torch.randn(50, 3, 3, generator=generator) ** torch.tensor([1.0, 2.0, 3.0])
    return omega, effect, series * torch.tensor([1.0, 1e-5, 1e-10])


@pytest.fixture
def decoder():
    torch.manual_seed(0)
    made = ModalDecoder(SIZES)
    made.frequency.copy_(torch.arange(1, 41) / 40.0)
    made.damping_bounds.copy_(torch.tensor([0.01, 0.05]))
    return made


def test_untrained_it_gives_the_response_of_the_mean_modes(decoder, modes):
    """Against `femupdate.benchmarks.modal_frf`, with geometric means of the frequencies."""
    omega, effect, series = modes
    decoder.standardise(omega, torch.ones_like(omega), effect, series, TOP)
    torch.nn.init.zeros_(decoder.modes.weight)
    zeta = torch.tensor([0.02, 0.045])
    z = torch.cat([torch.randn(2, 2), decoder.damping_coordinate(zeta)], dim=1)
    mean = ModalData(omega.log().mean(0).exp()[None], effect.mean(0)[None], series.mean(0)[None])
    both = ModalData(*(part.expand(2, *part.shape[1:]) for part in vars(mean).values()))
    frequency = torch.arange(1, 41) / 2.0
    expected = log_frf(both, frequency, ConstantDamping(), zeta)
    torch.testing.assert_close(decoder(z), expected, rtol=1e-4, atol=1e-4)


def test_the_last_coordinate_is_the_damping(decoder):
    zeta = torch.linspace(0.0101, 0.0499, 30)
    z = torch.cat([torch.zeros(30, 2), decoder.damping_coordinate(zeta)], dim=1)
    torch.testing.assert_close(decoder.damping(z), zeta, rtol=1e-4, atol=1e-6)
    # Uniform between its bounds where z is standard normal.
    draws = decoder.damping(torch.randn(4000, 3, generator=torch.Generator().manual_seed(0)))
    counts, _ = np.histogram(draws, bins=8, range=(0.01, 0.05))
    assert abs(counts - 500).max() < 5 * 500**0.5
