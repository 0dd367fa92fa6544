"""The time step of a column of times, or the row where the sampling breaks."""

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.measurement.text import TextFile
from femupdate.measurement.thresholds import TIMES


def check_step(file: TextFile, step: float, title: str | None = None) -> None:
    """Refuse a time step with which no building is measured.

    Args:
        file: where the step comes from.
        step: s.
        title: what messages call its column or channel.

    Raises:
        MeasurementError: it is none of the possible ones.
    """
    shortest, longest = TIMES.shortest_s, TIMES.longest_s
    if not shortest <= step <= longest:
        raise file.error(
            f"the time step is {step:.3g} s, and buildings are measured every {shortest:g} to"
            f" {longest:g} s; is the time's unit wrong?",
            column=title,
        )


def uniform_step(file: TextFile, time: Floats, lines: Integers, title: str) -> float:
    """Return the time step of uniformly sampled times, s.

    Printed times are rounded: a time may differ from the straight line through all of them by
    three quarters of its last printed digit, or by a hundredth of a step, whichever is larger.

    Args:
        file: where the times come from.
        time: (n,) at least three times, s.
        lines: (n,) their line numbers.
        title: what messages call their column.

    Raises:
        MeasurementError: a time does not increase, or the sampling is not uniform.
    """
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if backwards.size and np.mean(np.diff(time) <= 0) > 0.5:
        raise file.error("the times do not increase; sort the rows by time", None, title)
    check_step(file, float(np.median(np.diff(time))), title)
    digit = 10.0 ** -_decimals(time)
    time = time - time[0]
    step, start = np.polyfit(np.arange(time.size), time, 1)
    tolerance = min(max(0.75 * digit, TIMES.jitter * step), TIMES.coarsest * step)
    deviation = np.abs(time - (start + step * np.arange(time.size)))
    if backwards.size or deviation.max() > tolerance:
        _raise_uneven(file, time, lines, title)
    return _rounded_step(step, time.size, digit)


def _raise_uneven(file: TextFile, time: Floats, lines: Integers, title: str) -> None:
    steps = np.diff(time)
    usual = float(np.median(steps))
    worst = int(np.argmax(np.abs(steps - usual)))
    raise file.error(
        f"the sampling is not uniform: {steps[worst]:.6g} s after the row before, elsewhere"
        f" {usual:.6g} s; fill the gap or resample to one time step",
        int(lines[worst + 1]),
        title,
    )


def _decimals(time: Floats) -> int:
    """Number of decimals that the times are printed with."""
    scale = np.abs(time).max() * 1e-14
    for decimals in range(TIMES.decimals):
        if np.abs(np.round(time, decimals) - time).max() <= scale:
            return decimals
    return TIMES.decimals


def _rounded_step(step: float, count: int, digit: float) -> float:
    """Take the nearest whole sampling rate, or the nearest round step, that the digits allow."""
    allowed = digit / (count - 1)  # what the rounding of the first and last time allows
    rate = round(1.0 / step)
    if rate > 0 and abs(step - 1.0 / rate) <= allowed:
        return 1.0 / rate
    rounded = round(step, TIMES.decimals)
    return rounded if abs(step - rounded) <= allowed else float(step)
