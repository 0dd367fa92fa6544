"""What looks wrong in identified modes, in sentences."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from femupdate.measurement.modes import in_phase, phase_collinearity
from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.thresholds import RECORDED_MODE


def mode_findings(modes: Sequence[RecordedMode]) -> tuple[str, ...]:
    """Sentences on modes that are doubtful by themselves, then on pairs."""
    single = [text for mode in modes for text in _of_one(mode)]
    pairs = [
        f"{_called(one)} and {_called(other)} have nearly one frequency and one shape: this looks"
        " like one mode found twice"
        for one, other in combinations(modes, 2)
        if alike(one, other)
    ]
    return (*single, *pairs)


def mac(one: RecordedMode, other: RecordedMode) -> float:
    """Modal assurance criterion of two modes at the sensors that both have; NaN without any."""
    shared = [name for name in one.sensors if name in other.sensors]
    a, b = (
        np.asarray(mode.shape)[[mode.sensors.index(name) for name in shared]]
        for mode in (one, other)
    )
    there = ~(np.isnan(a) | np.isnan(b))
    a, b = a[there], b[there]
    length = float((np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum())
    return float(np.abs(np.vdot(a, b)) ** 2 / length) if len(a) > 1 and length > 0.0 else np.nan


def _of_one(mode: RecordedMode) -> list[str]:
    found, shape = [], np.asarray(mode.shape)
    if mode.damping is not None and not 0.0 < mode.damping <= RECORDED_MODE.much_damping:
        found.append(f"{_called(mode)} has a damping ratio of {mode.damping:.3g}")
    if (
        mode.frequency_sd_hz is not None
        and mode.frequency_sd_hz > RECORDED_MODE.wide * mode.frequency_hz
    ):
        found.append(f"{_called(mode)} is hardly known: ±{mode.frequency_sd_hz:.3g} Hz")
    seen = shape[~np.isnan(shape)]
    if seen.size and phase_collinearity(seen) < RECORDED_MODE.in_phase:
        found.append(f"{_called(mode)}: the sensors do not move in phase")
    if seen.size > 1 and not np.abs(in_phase(seen)).any():
        found.append(f"{_called(mode)}: every component of the shape is zero")
    return found


def _called(mode: RecordedMode) -> str:
    name = f"mode {mode.name} " if mode.name else "the mode "
    return f"{name}at {mode.frequency_hz:.4g} Hz"


def alike(one: RecordedMode, other: RecordedMode) -> bool:
    """Whether two modes look like one that was found twice."""
    if not (one.frequency_hz > 0.0 and other.frequency_hz > 0.0):
        return False
    close = abs(np.log(one.frequency_hz / other.frequency_hz)) < RECORDED_MODE.same_frequency
    return close and mac(one, other) > RECORDED_MODE.same_shape
