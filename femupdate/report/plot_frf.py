"""Measured against predicted frequency response functions, floor by floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from femupdate.arrays import Flags, Floats
from femupdate.report.figure import (
    add_head,
    checked,
    checked_names,
    nearly_all,
    panel_grid,
    thin_band_note,
)
from femupdate.report.style import BAND, BLUE, MEASURED, QUIET, styled

NOISE: dict[str, Any] = {"color": QUIET, "alpha": 0.28, "linewidth": 0.0}
LEFT_OUT: dict[str, Any] = {"color": QUIET, "linewidth": 1.0, "linestyle": (0, (1, 1.5))}


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
class MeasuredFrf:
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
    observation: MeasuredFrf | None = None,
    *,
    title: str = "Frequency response, floor over base",
) -> Figure:
    """Draw |H| of every floor, the top floor first: measured, its noise, predicted, its band.

    Args:
        frequency_hz: (m,).
        floors: f names, bottom to top.
        prediction, observation: ln|H| as they say.

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
    columns, width = (1, 10.0) if len(names) == 1 else (2, 5.0)
    figure, panels = panel_grid(len(names), columns, (width, 1.95), "Frequency, Hz", "|H|")
    for panel, floor in zip(panels, reversed(range(len(names))), strict=True):
        panel.plot(
            frequency, np.exp(mean[floor]), color=BLUE, linewidth=1.0, label="Predicted, mean"
        )
        low, high = np.exp(lower[floor]), np.exp(upper[floor])
        panel.fill_between(frequency, low, high, label=f"Predicted, {prediction.band}", **BAND)
        if measured is not None:
            _draw_measured(panel, frequency, measured, floor)
        panel.set_title(names[floor])
    start = 0.0 if frequency[0] < 0.05 * frequency[-1] else frequency[0]
    panels[0].set(yscale="log", xlim=(start, frequency[-1]))
    low, high = (np.log(limit) for limit in panels[0].get_ylim())
    note = thin_band_note(nearly_all(upper - lower) / (high - low))
    add_head(figure, title, note=note)
    return figure


@dataclass(frozen=True)
class _Measured:
    """Checked arrays; `used` and `unused` hold NaN where the other has the value."""

    used: Floats
    unused: Floats
    noise_sd: Floats | None

    @classmethod
    def of(cls, observation: MeasuredFrf, shape: tuple[int, int]) -> "_Measured":
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
    """Draw a floor's measurement below its prediction."""
    used, unused = measured.used[floor], measured.unused[floor]
    if not np.isfinite(np.stack([used, unused])).any():
        panel.set_title("not measured", loc="right", color=QUIET, fontweight="normal")
        return
    panel.plot(frequency, np.exp(used), label="Measured", **MEASURED)
    if measured.noise_sd is not None:
        twice, label = 2.0 * measured.noise_sd[floor], "Measured, ±2 sd of its noise"
        low, high = np.exp(used - twice), np.exp(used + twice)
        panel.fill_between(frequency, low, high, label=label, zorder=0.9, **NOISE)
    if np.isfinite(unused).any():
        panel.plot(frequency, np.exp(unused), zorder=1.9, label="Measured, left out", **LEFT_OUT)
