"""Measured against predicted frequency response functions, floor by floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from femupdate.arrays import Flags, Floats
from femupdate.report.figure import (
    add_head,
    checked,
    checked_names,
    label_edges,
    new_figure,
)
from femupdate.report.style import BLUE, INK, QUIET, styled

BAND: dict[str, Any] = {"color": BLUE, "alpha": 0.25, "linewidth": 0.0}
NOISE: dict[str, Any] = {"color": QUIET, "alpha": 0.28, "linewidth": 0.0}


@dataclass(frozen=True)
class Prediction:
    """Posterior predictive ln|H| of f floors at m frequencies.

    Attributes:
        mean: (f, m).
        lower, upper: (f, m) edges of the band.
        band: what the band is, for the legend.
    """

    mean: ArrayLike
    lower: ArrayLike
    upper: ArrayLike
    band: str = "5 to 95 %"


@dataclass(frozen=True)
class Observation:
    """Measured ln|H| of f floors at m frequencies; rows of NaN where a floor has no sensor.

    Attributes:
        log_frf: (f, m).
        noise_sd: (f, m) standard deviation of the noise, or None.
        valid: (f, m) False where the likelihood leaves the point out, or None.
    """

    log_frf: ArrayLike
    noise_sd: ArrayLike | None = None
    valid: ArrayLike | None = None


@styled
def frf_fit(
    frequency_hz: ArrayLike,
    floors: Sequence[str],
    prediction: Prediction,
    observation: Observation | None = None,
    *,
    title: str = "Frequency response, floor over base",
) -> Figure:
    """Draw |H| of every floor, the top floor first: measured, its noise, predicted, its band.

    Args:
        frequency_hz: (m,).
        floors: f names, bottom to top.
        prediction, observation: ln|H| as they say.
        title: over the figure.

    Raises:
        ReportError: an array has another shape.
    """
    frequency = checked("frequency_hz", frequency_hz, None)
    names = checked_names("floors", floors, len(np.atleast_2d(np.asarray(prediction.mean))))
    shape = (len(names), len(frequency))
    mean, lower, upper = (
        checked(name, getattr(prediction, name), *shape) for name in ("mean", "lower", "upper")
    )
    measured = None if observation is None else _Measured.of(observation, shape)
    columns = 1 if len(names) == 1 else 2
    rows = ceil(len(names) / columns)
    figure = new_figure(10.5, 0.6 + 1.95 * rows)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for place, floor in enumerate(reversed(range(len(names)))):
        panel = axes.flat[place]
        if measured is not None:
            _draw_measured(panel, frequency, measured, floor)
        panel.fill_between(frequency, np.exp(lower[floor]), np.exp(upper[floor]), **BAND)
        panel.plot(frequency, np.exp(mean[floor]), color=BLUE, linewidth=1.4)
        panel.set_title(names[floor])
    _finish(axes, len(names), frequency)
    add_head(figure, title, _handles(prediction.band, measured))
    return figure


@dataclass(frozen=True)
class _Measured:
    """Checked arrays; `used` and `unused` hold NaN where the other has the value."""

    used: Floats
    unused: Floats
    noise_sd: Floats | None

    @classmethod
    def of(cls, observation: Observation, shape: tuple[int, int]) -> "_Measured":
        values = checked("observed log_frf", observation.log_frf, *shape)
        noise = observation.noise_sd
        valid: Flags = np.ones(shape, dtype=bool)
        if observation.valid is not None:
            valid = checked("valid", observation.valid, *shape) > 0.5
        return cls(
            np.where(valid, values, np.nan),
            np.where(valid, np.nan, values),
            None if noise is None else checked("noise_sd", noise, *shape),
        )


def _draw_measured(panel: Axes, frequency: Floats, measured: _Measured, floor: int) -> None:
    used, unused = measured.used[floor], measured.unused[floor]
    if measured.noise_sd is not None:
        twice = 2.0 * measured.noise_sd[floor]
        panel.fill_between(frequency, np.exp(used - twice), np.exp(used + twice), **NOISE)
    panel.plot(frequency, np.exp(used), color=INK, linewidth=0.9)
    panel.plot(frequency, np.exp(unused), color=QUIET, linewidth=0.7, linestyle=(0, (1, 1.5)))
    if not np.isfinite(np.stack([used, unused])).any():
        panel.annotate(
            "not measured",
            (1.0, 1.0),
            xycoords="axes fraction",
            xytext=(0, 5),
            textcoords="offset points",
            ha="right",
            color=QUIET,
        )


def _finish(axes: NDArray[Any], floors: int, frequency: Floats) -> None:
    start = 0.0 if frequency[0] < 0.05 * frequency[-1] else frequency[0]
    axes.flat[0].set(yscale="log", xlim=(start, frequency[-1]))
    label_edges(axes, floors, "Frequency (Hz)", "|H|")


def _handles(band: str, measured: _Measured | None) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=BLUE, label="Predicted, mean"),
        Patch(label=f"Predicted, {band}", **BAND),
    ]
    if measured is None:
        return handles
    handles.append(Line2D([], [], color=INK, linewidth=0.9, label="Measured"))
    if measured.noise_sd is not None:
        handles.append(Patch(label="Measured, ±2 sd of its noise", **NOISE))
    if np.isfinite(measured.unused).any():
        dotted = Line2D([], [], color=QUIET, linestyle=(0, (1, 1.5)), label="Measured, left out")
        handles.append(dotted)
    return handles
