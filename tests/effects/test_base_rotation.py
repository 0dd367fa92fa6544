"""A base that turns: rigid rods, closed forms, equations by hand, and estimates of both inputs."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from femupdate.dynamics import (
    Excitation,
    floor_histories,
    transformed_sensors,
)
from femupdate.measurement import Histories, estimate_frf, parse_channel

ZETA = 0.03


def known(theta=(1.0,), sizes=(), zeta=ZETA):
    return (
        torch.tensor([list(theta)], dtype=torch.float64),
        torch.tensor([zeta], dtype=torch.float64),
        torch.tensor([list(sizes)], dtype=torch.float64),
    )


def turned(system, theta, zeta, sizes, frequency):
    """FRFs (N, f, k) to a unit rotation of the base."""
    return system.respond(Excitation(columns=2), theta, zeta, sizes, frequency)[:, :, 1]


def test_frames_and_sticks_with_effects_are_those_of_equations_by_hand(case):
    """Against dense matrices whose base is turned, with what else may be at the base."""
    labels = ("table_pitch@base", "channel_gain@RF")
    system = case.system(*labels)
    frequency = torch.from_numpy(case.frequency_hz)
    found = turned(system, *known(case.theta, (0.05, 0.1)), frequency)[0].numpy()
    exact = case.equations.but(moved=(0.0, 1.0), pitch=0.05).frf(case.frequency_hz, ZETA)
    exact[-1] *= 1.1  # the pitch goes with a translation that is zero
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-8 * np.abs(exact).max())


def integrated(equations, base, rotation, step):
    """Absolute accelerations (f, n) by DOP853, both motions straight between samples."""
    time, size = step * np.arange(len(base)), len(equations.K)
    root = np.sqrt(np.diag(equations.M))
    squared, modes = np.linalg.eigh(equations.K / np.outer(root, root))
    C = root[:, None] * (modes * (2.0 * ZETA * np.sqrt(squared))) @ modes.T * root
    inverse = 1.0 / np.diag(equations.M)

    def rate(t, y):
        moved = np.array([np.interp(t, time, base), np.interp(t, time, rotation)])
        force = -equations.force @ moved - C @ y[size:] - equations.K @ y[:size]
        return np.concatenate([y[size:], inverse * force])

    span = (0.0, time[-1])
    y = solve_ivp(
        rate, span, np.zeros(2 * size), "DOP853", time, max_step=step, rtol=1e-9, atol=1e-12
    ).y.T
    acceleration = -((y[:, size:] @ C + y[:, :size] @ equations.K) * inverse).T
    return acceleration, y[:, :size].T


def smooth(seed, count):
    """Noise without what a line between samples would miss."""
    raw = np.random.default_rng(seed).standard_normal(count)
    spectrum = np.fft.rfft(raw)
    spectrum[count // 20 :] = 0.0
    return np.fft.irfft(spectrum, count) * np.hanning(count)


def test_histories_of_both_motions_are_those_of_an_integrator(stick):
    step, count = 0.01, 600
    base, rotation = smooth(1, count), 0.3 * smooth(2, count)
    exact, moved = integrated(stick.equations, base, rotation, step)
    record = np.stack([base, rotation])
    theta, _, _ = known(stick.theta)
    found = floor_histories(stick.system(), theta, ZETA, record, step)
    scale = np.abs(exact).max()
    np.testing.assert_allclose(found.floor_acceleration[0], exact, atol=2e-3 * scale)
    # Drifts strain the stories: the tilt of the base itself is none.
    drift = np.diff(moved, axis=0, prepend=0.0)
    np.testing.assert_allclose(found.story_drift[0], drift, atol=2e-3 * np.abs(drift).max())
    shear = np.cumsum((np.diag(stick.equations.M)[:, None] * exact)[::-1], axis=0)[::-1]
    np.testing.assert_allclose(found.story_shear[0], -shear, atol=2e-3 * np.abs(shear).max())
    sensors = transformed_sensors(stick.system(), known(stick.theta), record, step)
    np.testing.assert_allclose(sensors, exact, atol=2e-3 * scale)


STEP, GRID = 0.02, np.arange(1, 121) * 0.1
NOISE = 0.2
PLACES = (-2.5, 4.0)  # not alike: a sign or a mean cannot hide


def recorded(stick, seed, envelope=1.0, samples=4000, noise=0.0, own=0.06):
    """Histories of a stick under translation and a rotation, half of which goes with it."""
    rng = np.random.default_rng(seed)
    base = envelope * rng.standard_normal(samples)
    rotation = 0.06 * base + own * envelope * rng.standard_normal(samples)
    lift = 0.2 * rng.standard_normal(samples)  # of the whole base
    motion = transformed_sensors(
        stick.system(), known(stick.theta), np.stack([base, rotation]), STEP
    )
    vertical = [lift - place * rotation for place in PLACES]
    names = ["base", *(f"base@{place}.z" for place in PLACES), *stick.structure.floors]
    rows = np.stack([base, *vertical, *motion])
    rows = rows + noise * rng.standard_normal(rows.shape)
    return Histories(STEP, tuple(parse_channel(name) for name in names), rows, "both")


def shock(samples=4000):
    time = STEP * np.arange(samples)
    return np.exp(-(((time - 15.0) / 4.0) ** 2))


def missed(stick, observation):
    """rms over valid points of ln|H| less the model's, as the estimate shows it; and its noise."""
    estimator, system = observation.estimator, stick.system()
    frequency = torch.from_numpy(estimator.frequency_hz)
    seen = system.seen_frf(*known(stick.theta), frequency, estimator)[0].numpy()
    valid = observation.valid
    away = (np.log(np.abs(seen)) - observation.log_frf)[valid]
    turn = np.angle(seen * np.exp(-1j * observation.phase))[valid]
    return np.sqrt((away**2).mean()), np.sqrt((turn**2).mean()), valid.mean()


@pytest.mark.parametrize("envelope", [1.0, "shock"], ids=["noise", "shock"])
def test_estimates_of_both_inputs_are_those_of_the_model(stick, envelope):
    data = recorded(stick, 5, shock() if envelope == "shock" else 1.0)
    observation = estimate_frf(data, GRID)
    size, turn, share = missed(stick, observation)
    assert max(size, turn) < 0.01
    assert share > 0.9
    # By the translation alone they are far off: this rotation is no small thing.
    without = estimate_frf(
        Histories(STEP, (data.channels[0], *data.channels[3:]), data.acceleration[[0, 3, 4, 5, 6]]),
        GRID,
    )
    # What follows the rotation alone is taken for noise of the base, by .2 % of |H| at most.
    np.testing.assert_allclose(without.log_frf, observation.log_frf, atol=0.005)
    assert missed(stick, without)[0] > 0.1


def test_noise_is_what_neither_translation_nor_rotation_explains(stick):
    """Rotation that does not go with the translation is an input, not noise."""
    squares, stated = [], []
    for seed in range(6):
        data = recorded(stick, seed, noise=NOISE, own=0.4)
        observation = estimate_frf(data, GRID)
        frequency = torch.from_numpy(observation.estimator.frequency_hz)
        seen = stick.system().seen_frf(*known(stick.theta), frequency, observation.estimator)
        away = np.log(seen[0].abs().numpy()) - observation.log_frf
        squares.append((away / observation.noise_sd)[observation.valid] ** 2)
        without = replace(
            data,
            channels=(data.channels[0], *data.channels[3:]),
            acceleration=data.acceleration[[0, 3, 4, 5, 6]],
        )
        ordinary = estimate_frf(without, GRID).noise_sd
        stated.append(np.median(ordinary / observation.noise_sd))
    # Six records of 15 averages: the mean square has a standard deviation of .05.
    assert 0.8 < np.concatenate(squares).mean() < 1.2
    assert min(stated) > 1.3
