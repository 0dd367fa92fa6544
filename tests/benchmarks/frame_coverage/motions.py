"""Motions of the base: white noise, a recorded earthquake and simulated ones."""

from importlib.resources import as_file, files

import numpy as np
from scipy.signal import lfilter

from femupdate.measurement import GroundMotion, read_record
from femupdate.simulation import white_noise

WHITE, RECORDED, SIMULATED = "white noise", "recorded earthquake", "simulated earthquake"
RATE_HZ = 100.0
_BAND_HZ = (0.3, 40.0)
_WHITE_S, _QUAKE_S = 120.0, 60.0
_RECORD = "ridgecrest_2019_clc_90.csv"
_STRONG = slice(2000, 8000)  # samples of the record


def base_motion(kind: str, rng: np.random.Generator) -> GroundMotion:
    """A motion of one of the kinds, with a strength and a soil of its own."""
    if kind == WHITE:
        return white_noise(_WHITE_S, RATE_HZ, rng.uniform(0.2, 1.0), _BAND_HZ, rng)
    found = _recorded() if kind == RECORDED else _simulated(rng)
    return found.scaled(rng.uniform(0.5, 3.0) / found.peak)


def _recorded() -> GroundMotion:
    with as_file(files("femupdate.examples") / "records" / _RECORD) as path:
        whole = read_record(path)
    return GroundMotion(whole.acceleration[_STRONG], whole.time_step, RECORDED)


def _simulated(rng: np.random.Generator) -> GroundMotion:
    """White noise under an envelope, through a layer of soil (Kanai 1957, Tajimi 1960)."""
    time = np.arange(round(_QUAKE_S * RATE_HZ)) / RATE_HZ
    rise, strong, decay = rng.uniform(1.0, 4.0), rng.uniform(4.0, 15.0), rng.uniform(0.15, 0.5)
    late = np.maximum(time - rise - strong, 0.0)
    envelope = np.minimum(time / rise, 1.0) ** 2 * np.exp(-decay * late)
    own, ratio = 2.0 * np.pi * rng.uniform(2.0, 8.0), rng.uniform(0.3, 0.7)
    noise = envelope * rng.standard_normal(time.size)
    # Both layers by their impulse responses: the absolute motion of an oscillator on the rock.
    lag = np.arange(200) / RATE_HZ
    damped = own * np.sqrt(1.0 - ratio**2)
    fading = np.exp(-ratio * own * lag)
    kernel = fading * (
        2.0 * ratio * own * np.cos(damped * lag)
        + own**2 * (1.0 - 2.0 * ratio**2) / damped * np.sin(damped * lag)
    )
    moved = lfilter(kernel, [1.0], noise) / RATE_HZ
    return GroundMotion(moved - moved.mean(), 1.0 / RATE_HZ, SIMULATED)
