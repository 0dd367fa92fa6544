"""A model's FRF as an estimate shows it, against estimates from exact responses to a shock."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.measurement import Histories, estimate_frf, mean_estimator, parse_channel

STEP, GRID = 0.02, np.arange(1, 201) * 0.05


def frf(frequency_hz, zeta, own_hz=3.0):
    """Absolute acceleration of an oscillator over that of its base."""
    ratio = np.asarray(frequency_hz) / own_hz
    return (1.0 + 2j * zeta * ratio) / (1.0 - ratio**2 + 2j * zeta * ratio)


def bell(time):
    return np.exp(-(((time - 15.0) / 4.0) ** 2))


def dying_away(time):
    """Strong for ten seconds, then for longer than a segment weaker and weaker."""
    return np.minimum(np.minimum((time / 3.0) ** 2, 1.0), np.exp(-(time - 13.0) / 12.0))


def shaken(zeta, seed=0, samples=4000, envelope=bell):
    """Histories of a shock of some seconds in a record of eighty, with the exact response."""
    base = envelope(STEP * np.arange(samples)) * np.random.default_rng(seed).standard_normal(
        samples
    )
    padded = 4 * samples
    motion = np.fft.irfft(frf(np.fft.rfftfreq(padded, STEP), zeta) * np.fft.rfft(base, padded))
    channels = tuple(parse_channel(name) for name in ("base", "RF"))
    return Histories(STEP, channels, np.stack([base, motion[:samples]]), "shock")


def missed(observation, values):
    """rms over valid points of ln|H| and of the phase, rad."""
    valid = observation.valid[0]
    away = np.log(np.abs(values[valid])) - observation.log_frf[0, valid]
    turn = np.angle(values * np.exp(-1j * observation.phase[0]))[valid]
    return np.sqrt(np.mean(away**2)), np.sqrt(np.mean(turn**2))


@pytest.mark.parametrize("zeta", [0.01, 0.03])
def test_a_shock_is_estimated_of_the_model_as_of_its_response(zeta):
    """The FRF itself is off by percents; through the base motion's own means it is not."""
    observation = estimate_frf(shaken(zeta), GRID)
    seen = observation.estimator
    asked = torch.from_numpy(frf(seen.frequency_hz, zeta))[None, None]
    through = missed(observation, seen(asked)[0, 0].numpy())
    itself = missed(observation, frf(GRID, zeta))
    assert max(through) < 0.004
    assert min(itself) > 4.0 * max(through)


@pytest.mark.parametrize("zeta", [0.01, 0.03])
@pytest.mark.parametrize("seed", range(3))
def test_a_motion_that_dies_away_over_segments_is_estimated_as_well(zeta, seed):
    """Its means turn in phase so fast that they are a small part of their absolute values."""
    grid = np.arange(1, 501) * 0.02
    observation = estimate_frf(shaken(zeta, seed, 6000, dying_away), grid)
    seen = observation.estimator
    asked = torch.from_numpy(frf(seen.frequency_hz, zeta))[None, None]
    values = seen(asked)[0, 0].numpy()
    used = observation.valid[0]
    used[grid < 0.1] = False  # where the record's mean counts
    assert max(missed(replace(observation, valid=used[None]), values)) < 0.0015


def test_an_frf_that_is_one_everywhere_stays_one():
    seen = estimate_frf(shaken(0.02), GRID).estimator
    one = torch.ones(1, 1, len(seen.frequency_hz), dtype=torch.complex128)
    np.testing.assert_allclose(seen(one)[0, 0].numpy(), 1.0, rtol=1e-9)


def test_runs_together_are_the_means_of_their_estimates():
    parts = [estimate_frf(shaken(0.02, seed), GRID).estimator for seed in (0, 1)]
    shares = np.stack([np.linspace(0.2, 0.8, GRID.size), np.linspace(0.8, 0.2, GRID.size)])

    def estimate(part):
        return part(torch.from_numpy(frf(part.frequency_hz, 0.02))[None, None])[0, 0].numpy()

    together = estimate(mean_estimator(parts, shares, GRID))
    expected = sum(share * estimate(part) for share, part in zip(shares, parts, strict=True))
    np.testing.assert_allclose(together, expected, rtol=1e-9)
    assert mean_estimator([None, None], shares, GRID) is None
