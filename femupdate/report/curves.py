"""Curves with their bands, described once for pictures and tables.

Names and titles begin with a small letter, which pictures make a capital.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from femupdate.arrays import Flags, Floats
from femupdate.measurement.observation import Observation

Edges = tuple[str, Floats, Floats]  # of a band: its name, and (f, n) either side

PREDICTED, MEASURED, LEFT_OUT = "predicted, mean", "measured", "measured, left out"
_ALONE = "of the parameters alone"


@dataclass(frozen=True, kw_only=True)
class CurveBand:
    """A band (n,) about a curve, named as in "predicted, 5 to 95 %"."""

    name: str
    low: Floats
    high: Floats


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A mean with its bands, and what was measured, for one panel.

    Attributes:
        title: of the panel, such as a floor.
        across, up: titles of the axes, with their units.
        x, mean: (n,).
        name: of the mean.
        bands: drawn behind it, the widest first; the last is that of the parameters.
        measured: (n,) NaN where nothing was measured, or None.
        noise: (n,) standard deviation of ln(measured), or None.
        used: (n,) whether a measured point counts; None where all do.
        beside: (n,) another line, such as that of the ground, or None.
    """

    title: str
    across: str
    up: str
    x: Floats
    mean: Floats
    name: str = PREDICTED
    bands: tuple[CurveBand, ...] = ()
    measured: Floats | None = None
    noise: Floats | None = None
    used: Flags | None = None
    beside: Floats | None = None

    def seen(self, *, used: bool) -> Floats | None:
        """(n,) what was measured and counts, or does not; None where there is no such point."""
        if self.measured is None or (self.used is None and not used):
            return None
        counts = True if self.used is None else self.used == used
        values = np.where(counts, self.measured, np.nan)
        return values if np.isfinite(values).any() else None

    def at(self, kept: Any) -> "Curve":
        """The same at some of its points, by an index or a mask."""
        chosen: dict[str, Any] = {
            name: None if value is None else value[kept]
            for name in ("x", "mean", "measured", "noise", "used", "beside")
            for value in (getattr(self, name),)
        }
        bands = tuple(
            replace(band, low=band.low[kept], high=band.high[kept]) for band in self.bands
        )
        return replace(self, bands=bands, **chosen)


@dataclass(frozen=True, kw_only=True)
class Interval:
    """Rows (r,) with a mean and an interval each; `series` is the number of the colour of all."""

    name: str
    mean: Floats
    low: Floats
    high: Floats
    series: int = 0

    @classmethod
    def of(cls, draws: Floats, label: str = "", series: int = 0) -> "Interval":
        """Mean and 5 to 95 % of draws (S, r)."""
        low, high = np.quantile(draws, [0.05, 0.95], axis=0)
        told = "mean, 5 to 95 %"
        name = f"{label}: {told}" if label else told
        return cls(name=name, mean=draws.mean(axis=0), low=low, high=high, series=series)


def response_curves(
    predicted: Floats, seen: Observation, erring: tuple[Floats, Floats] | None = None
) -> tuple[Curve, ...]:
    """|H| of every floor, the top floor first: predicted, its bands, and measured.

    Args:
        predicted: (S, f, m) ln|H| of draws.
        seen: of all f floors, with rows of NaN where a floor has no sensor.
        erring: (f, m) 5 and 95 % of ln|H| with the error of the model, if one is known.
    """
    low, high = np.quantile(predicted, [0.05, 0.95], axis=0)
    edges: list[Edges] = [("predicted, 5 to 95 %", low, high)]
    if erring is not None:
        edges = [
            ("with the error of the model, 5 to 95 %", *erring),
            (f"{_ALONE}, 5 to 95 %", low, high),
        ]
    return tuple(
        Curve(
            title=seen.floors[row],
            across="frequency, Hz",
            up="|H|",
            x=seen.frequency_hz,
            mean=np.exp(predicted[:, row].mean(axis=0)),
            bands=_bands([(name, np.exp(low), np.exp(high)) for name, low, high in edges], row),
            measured=np.exp(seen.log_frf[row]),
            noise=seen.noise_sd[row],
            used=seen.valid[row],
        )
        for row in reversed(range(len(seen.floors)))
    )


def history_curves(
    time: Floats,
    floors: Sequence[str],
    mean: Floats,
    sd: Floats,
    *,
    alone: tuple[Floats, Floats] | None = None,
    measured: Floats | None = None,
) -> tuple[Curve, ...]:
    """Accelerations of the floors, the top floor first, with bands of two sd either way.

    Args:
        time: (n,) s.
        floors: f names, bottom to top.
        mean, sd: (f, n) over the posterior samples, m/s2.
        alone: mean and sd (f, n) of the parameters alone, m/s2, whose band lies inside.
        measured: (f, n) m/s2 with rows of NaN where a floor has no sensor, or None.
    """
    named = {"predicted, mean ± 2 sd": (mean, sd)} | ({} if alone is None else {_ALONE: alone})
    edges = [(name, m - 2.0 * s, m + 2.0 * s) for name, (m, s) in named.items()]
    return tuple(
        Curve(
            title=str(floors[row]),
            across="time, s",
            up="acceleration, m/s²",
            x=time,
            mean=mean[row],
            bands=_bands(edges, row),
            measured=None if measured is None else measured[row],
        )
        for row in reversed(range(len(floors)))
    )


def spectrum_curves(
    frequency_hz: Floats,
    floors: Sequence[str],
    mean: Floats,
    sd: Floats,
    ground: Floats | None = None,
) -> tuple[Curve, ...]:
    """Response spectra of the floors, the top floor first, with bands of two sd either way.

    Args:
        frequency_hz: (k,) of the oscillators, ascending.
        floors: f names, bottom to top.
        mean, sd: (f, k) over the posterior samples, m/s2.
        ground: (k,) spectrum of the ground motion, m/s2, or None.
    """
    curves = history_curves(frequency_hz, floors, mean, sd)
    return tuple(
        replace(curve, across="frequency of the oscillator, Hz", beside=ground) for curve in curves
    )


def _bands(edges: Sequence[Edges], row: int) -> tuple[CurveBand, ...]:
    return tuple(CurveBand(name=name, low=low[row], high=high[row]) for name, low, high in edges)
