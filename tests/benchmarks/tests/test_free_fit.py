"""Rivals beside which predictions of measured events are told: free modes, impulse responses."""

import numpy as np
import pytest
from femupdate.benchmarks.measured.free_fit import fit_free
from femupdate.benchmarks.measured.impulse_filter import fit_filter
from scipy.signal import cont2discrete, dlsim, lfilter

from femupdate.measurement import FloorChannel, Histories
from femupdate.measurement.names import BASE

STEP = 0.01
FREQUENCY, DAMPING = np.array([2.1, 6.3]), np.array([0.03, 0.015])
PARTICIPATION = np.array([[0.8, 1.3], [0.25, -0.35]])


def event(seed):
    """Two floors of two modes, integrated step by step, under a base that dies away."""
    time = STEP * np.arange(4000)
    base = np.random.default_rng(seed).standard_normal(len(time)) * np.exp(-time / 6.0)
    moved = []
    for omega, ratio in zip(2.0 * np.pi * FREQUENCY, DAMPING, strict=True):
        state = np.array([[0.0, 1.0], [-(omega**2), -2.0 * ratio * omega]])
        out = state[1:], np.array([[-1.0]])
        whole = cont2discrete((state, np.array([[0.0], [-1.0]]), *out), STEP, "foh")
        moved.append(dlsim(whole, base)[1][:, 0])
    floors = base + PARTICIPATION.T @ np.array(moved)
    channels = tuple(FloorChannel(name, name) for name in (BASE, "2F", "RF"))
    return Histories(STEP, channels, np.vstack([base, floors]), "two modes")


@pytest.mark.parametrize("count", [1, 2])
def test_free_modes_are_found_and_predict_another_event(count):
    fit = fit_free([event(seed) for seed in range(count)], "x", (0.5, 12.0), 2)
    order = np.argsort(fit.frequency_hz)
    np.testing.assert_allclose(fit.frequency_hz[order], FREQUENCY, rtol=0.005)
    np.testing.assert_allclose(fit.damping[order], DAMPING, rtol=0.1)
    np.testing.assert_allclose(fit.participation[order], PARTICIPATION, atol=0.05)
    assert fit.error(event(9), "x").max() < 0.05


def test_an_impulse_response_predicts_another_event_and_knows_how_well():
    """Floors that follow the base by a response of half a second, and a tenth of noise."""
    time = STEP * np.arange(100)
    taps = 0.05 * np.exp(-time / 0.1) * np.cos(2.0 * np.pi * 4.0 * time)

    def answered(seed):
        rng = np.random.default_rng(seed)
        base = rng.standard_normal(3000)
        floor = base + lfilter(taps, [1.0], base)
        floor += 0.1 * floor.std() * rng.standard_normal(3000)
        channels = tuple(FloorChannel(name, name) for name in (BASE, "RF"))
        return Histories(STEP, channels, np.vstack([base, floor]), "a response")

    fitted = fit_filter([answered(seed) for seed in range(5)], "x")
    error, score = fitted.scores(answered(9), "x")
    assert error == pytest.approx(0.1, rel=0.1)
    # Of a normal error with a band of its own sd (Gneiting and Raftery 2007).
    assert score == pytest.approx(error / np.sqrt(np.pi), rel=0.1)
