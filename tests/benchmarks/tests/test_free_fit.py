"""The free modal fit beside which predictions of measured events are told."""

import numpy as np
import pytest
from femupdate.benchmarks.measured.free_fit import fit_free
from scipy.signal import cont2discrete, dlsim

from femupdate.measurement.histories import Histories
from femupdate.measurement.names import BASE, FloorChannel

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
