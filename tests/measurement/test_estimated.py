"""A model's FRF as an estimate shows it, against estimates from exact responses to a shock."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.measurement import (
    Histories,
    estimate_frf,
    mean_estimator,
    noise_of_lines,
    parse_channel,
)

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


def shaken(zeta, seed=0, samples=4000, envelope=bell, own_hz=3.0):
    """Histories of a shock of some seconds in a record of eighty, with the exact response."""
    base = envelope(STEP * np.arange(samples)) * np.random.default_rng(seed).standard_normal(
        samples
    )
    padded = 4 * samples
    exact = frf(np.fft.rfftfreq(padded, STEP), zeta, own_hz)
    motion = np.fft.irfft(exact * np.fft.rfft(base, padded))
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


@pytest.mark.parametrize("seed", [31, 34, 38])
def test_peaks_narrower_than_the_window_are_resolved(seed):
    """Segments of ten seconds have a bandwidth of .15 Hz, the peak one of .026 Hz."""
    zeta, own_hz, grid = 0.006, 2.145, np.arange(2, 81) * 0.1
    observation = estimate_frf(shaken(zeta, seed, 2000, np.ones_like, own_hz), grid)
    seen, used = observation.estimator, observation.valid[0]
    asked = torch.from_numpy(frf(seen.frequency_hz, zeta, own_hz))[None, None]
    away = observation.log_frf[0] - np.log(np.abs(seen(asked)[0, 0].numpy()))
    # By cubics over thirds of a bandwidth .09 to .16. What is left leaks from further away.
    assert np.abs(away[used]).max() < 0.05


def test_an_frf_that_is_one_everywhere_stays_one():
    seen = estimate_frf(shaken(0.02), GRID).estimator
    one = torch.ones(1, 1, len(seen.frequency_hz), dtype=torch.complex128)
    np.testing.assert_allclose(seen(one)[0, 0].numpy(), 1.0, rtol=1e-9)


# A tower in motion when the record begins, and a quake that strikes it at rest: s, noise over the
# base's rms, damping.
NOISY = [(120.0, 0.1, 0.02, False), (20.0, 0.02, 0.01, False), (40.0, 0.05, 0.005, True)]


def measured_tower(seconds, noise, zeta, quake, seed):
    """Noisy histories of three equal stories by exact responses, FRF, density of the noise.

    The motion is periodic over four times the record, of which the last quarter is measured.
    """
    rng, count, step = np.random.default_rng(seed), int(seconds / 0.01), 0.01
    chain = 3000.0 * (np.diag([2.0, 2.0, 1.0]) - np.eye(3, k=1) - np.eye(3, k=-1))
    squares, shapes = np.linalg.eigh(chain)
    part = shapes * shapes.sum(axis=0)

    def frf(frequency_hz):
        omega = 2.0 * np.pi * np.asarray(frequency_hz)
        below = squares[:, None] - omega**2 + 2j * zeta * np.sqrt(squares)[:, None] * omega
        return 1.0 + part @ (omega**2 / below)

    base = rng.standard_normal(4 * count)
    if quake:
        time = step * np.arange(4 * count) - 3.0 * seconds
        rise = np.clip((time - 0.1 * seconds) / (0.05 * seconds), 0.0, 1.0)
        base *= rise * np.exp(-np.clip((time - 0.2 * seconds) / (0.12 * seconds), 0.0, None))
    spectrum = np.fft.rfft(base)
    fine = np.fft.rfftfreq(4 * count, step)
    spectrum[(fine < 0.3) | (fine > 40.0)] = 0.0
    motion = np.fft.irfft(np.vstack([spectrum, frf(fine) * spectrum]), 4 * count)[:, -count:]
    sd = noise * motion[0].std()
    channels = tuple(parse_channel(name) for name in ("base", "2F", "3F", "RF"))
    rows = motion + sd * rng.standard_normal(motion.shape)
    return Histories(step, channels, rows, "tower"), frf, 2.0 * step * sd**2


@pytest.mark.parametrize("case", NOISY)
def test_noise_is_told_from_what_leaks_without_a_model(case):
    """Of each floor that of its sensor, and that of the base which it does not follow."""
    histories, frf, density = measured_tower(*case, seed=1)
    base, floors, _ = histories.means("x")
    frequency, across = noise_of_lines(base[None], floors, histories.time_step, 20.0)
    left = np.einsum("iil->il", across).real
    ratio = left / (density * (1.0 + np.abs(frf(frequency)) ** 2))
    # Some 90 to 800 windows of eight degrees of freedom, half of them apart; coherence has 2 to 400
    # times as much beside the peaks. At a few lines a peak ends within a window.
    assert ratio.mean() == pytest.approx(1.0, abs=0.15)
    assert np.median(ratio) == pytest.approx(0.95, abs=0.12)


@pytest.mark.parametrize("case", NOISY)
def test_errors_of_estimates_are_those_stated_and_floors_share_what_the_base_has(case):
    grid, squares, common = np.arange(6, 481) * 0.05, [], []
    for seed in range(6):
        histories, frf, _ = measured_tower(*case, seed=seed)
        observation = estimate_frf(histories, grid)
        seen = observation.estimator
        expected = seen(torch.from_numpy(frf(seen.frequency_hz))[None])[0].numpy()
        used = observation.valid.all(axis=0)
        away = (observation.log_frf - np.log(np.abs(expected)))[:, used]
        noise, shared = observation.noise_sd[:, used], seen.shared[used]
        for miss, sd, of_all in zip(away.T, noise.T, shared, strict=True):
            cover = np.diag(sd**2 - of_all**2) + of_all**2
            values, vectors = np.linalg.eigh(cover)
            white = (vectors.T @ miss) ** 2 / values
            squares.append(white[:-1].mean())
            common.append(white[-1])
    # Of some 600 independent points; the least noise that is believed is more than there is at a
    # few. Counted as independent, errors of floors would come out at .3 and at 2.
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)
    assert np.mean(common) == pytest.approx(1.0, abs=0.25)


def test_runs_together_are_the_means_of_their_estimates():
    parts = [estimate_frf(shaken(0.02, seed), GRID).estimator for seed in (0, 1)]
    shares = np.stack([np.linspace(0.2, 0.8, GRID.size), np.linspace(0.8, 0.2, GRID.size)])

    def estimate(part):
        return part(torch.from_numpy(frf(part.frequency_hz, 0.02))[None, None])[0, 0].numpy()

    together = estimate(mean_estimator(parts, shares, GRID))
    expected = sum(share * estimate(part) for share, part in zip(shares, parts, strict=True))
    np.testing.assert_allclose(together, expected, rtol=1e-9)
    assert mean_estimator([None, None], shares, GRID) is None
