"""What looks wrong in identified modes, in sentences."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from femupdate.measurement.modes import in_phase, phase_collinearity
from femupdate.measurement.recording import RecordedMode

# Buildings lose 0.5 to 10 % of critical damping in a mode.
_MUCH_DAMPING = 0.1
_IN_PHASE = 0.9
# Two modes of one building with such shapes at such frequencies are one mode, found twice.
_SAME_SHAPE, _SAME_FREQUENCY = 0.95, 0.02
_WIDE = 0.1  # standard deviation of a frequency, over it


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
    if mode.damping is not None and not 0.0 < mode.damping <= _MUCH_DAMPING:
        found.append(f"{_called(mode)} has a damping ratio of {mode.damping:.3g}")
    if mode.frequency_sd_hz is not None and mode.frequency_sd_hz > _WIDE * mode.frequency_hz:
        found.append(f"{_called(mode)} is hardly known: ±{mode.frequency_sd_hz:.3g} Hz")
    seen = shape[~np.isnan(shape)]
    if seen.size and phase_collinearity(seen) < _IN_PHASE:
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
    close = abs(np.log(one.frequency_hz / other.frequency_hz)) < _SAME_FREQUENCY
    return close and mac(one, other) > _SAME_SHAPE
