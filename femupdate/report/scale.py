"""Units and figures that keep the numbers of a drawing short."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats


@dataclass(frozen=True)
class Scale:
    """A unit for display, used from the SI value `start` on: SI value = value shown x factor."""

    unit: str
    factor: float
    start: float


_FORCE = (Scale("N", 1.0, 0.0), Scale("kN", 1e3, 1e3), Scale("MN", 1e6, 5e6))
_MASS = (Scale("g", 1e-3, 0.0), Scale("kg", 1.0, 0.1), Scale("t", 1e3, 1e3))
# Engineers think of drifts in mm, also in tenths of one and in hundreds.
_LENGTH = (Scale("µm", 1e-6, 0.0), Scale("mm", 1e-3, 5e-5), Scale("m", 1.0, 2.0))


def force_scale(values: ArrayLike) -> Scale:
    """Return N, kN or MN, whichever suits the largest of the values, N."""
    return _suiting(_FORCE, values)


def length_scale(values: ArrayLike) -> Scale:
    """Return µm, mm or m, whichever suits the largest of the values, m."""
    return _suiting(_LENGTH, values)


def mass_scale(values: ArrayLike) -> Scale:
    """Return g, kg or t, whichever suits the largest of the values, kg."""
    return _suiting(_MASS, values)


def _suiting(scales: tuple[Scale, ...], values: ArrayLike) -> Scale:
    largest = float(np.max(np.abs(np.asarray(values, dtype=float)), initial=0.0))
    return [scale for scale in scales if scale.start <= largest][-1]


def interval_text(mean: float, sd: float, low: float, high: float) -> str:
    """Mean and interval with two figures of the standard deviation, four of the mean at most."""
    decimals = 3 - int(np.floor(np.log10(abs(mean)))) if mean else 3
    if sd > 0.0:
        decimals = min(decimals, 1 - int(np.floor(np.log10(sd))))
    shown = max(decimals, 0)
    return f"{mean:.{shown}f} [{low:.{shown}f}, {high:.{shown}f}]"


def range_text(draws: Floats) -> str:
    """The interval that holds 90 % of draws (n,), with two figures of their deviation."""
    low, high, sd = *np.quantile(draws, [0.05, 0.95]), float(draws.std())
    decimals = max(0, 1 - int(np.floor(np.log10(sd)))) if sd > 0.0 else 4
    return f"{low:.{decimals}f} to {high:.{decimals}f}"


def plus_minus(mean: float, sd: float) -> str:
    """Return mean ± standard deviation with two figures of the latter."""
    if not sd > 0.0:
        return f"{mean:.4g}"
    decimals = max(0, 1 - int(np.floor(np.log10(sd))))
    shown = round(mean, decimals) + 0.0  # no minus before a zero
    return f"{shown:.{decimals}f} ± {sd:.{decimals}f}"


def with_unit(mean: float, sd: float, unit: str) -> str:
    """Return mean ± standard deviation and the unit of both, such as "9.79 ± 0.33 %"."""
    return f"{plus_minus(mean, sd)} {unit}"
