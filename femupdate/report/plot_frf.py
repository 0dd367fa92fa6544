"""Measured against predicted frequency response functions, floor by floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from femupdate.arrays import Flags, Floats
from femupdate.report.figure import add_head, nearly_all, panel_grid, thin_band_note
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

    mean: Floats
    lower: Floats
    upper: Floats
    band: str = "5 to 95 %"


@dataclass(frozen=True)
class MeasuredFrf:
    """Measured ln|H| of f floors at m frequencies; rows of NaN where a floor has no sensor.

    Attributes:
        log_frf: (f, m).
        noise_sd: (f, m) standard deviation of the noise, or None.
        valid: (f, m) False where the likelihood leaves the point out, or None.
    """

    log_frf: Floats
    noise_sd: Floats | None = None
    valid: Flags | None = None


@styled
def frf_fit(
    frequency_hz: Floats,
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
    """
    columns, width = (1, 10.0) if len(floors) == 1 else (2, 5.0)
    figure, panels = panel_grid(len(floors), columns, (width, 1.95), "Frequency, Hz", "|H|")
    label = f"Predicted, {prediction.band}"
    for panel, floor in zip(panels, reversed(range(len(floors))), strict=True):
        mean = np.exp(prediction.mean[floor])
        panel.plot(frequency_hz, mean, color=BLUE, linewidth=1.0, label="Predicted, mean")
        low, high = np.exp(prediction.lower[floor]), np.exp(prediction.upper[floor])
        panel.fill_between(frequency_hz, low, high, label=label, **BAND)
        if observation is not None:
            _draw_measured(panel, frequency_hz, observation, floor)
        panel.set_title(floors[floor])
    start = 0.0 if frequency_hz[0] < 0.05 * frequency_hz[-1] else frequency_hz[0]
    panels[0].set(yscale="log", xlim=(start, frequency_hz[-1]))
    bottom, top = (np.log(limit) for limit in panels[0].get_ylim())
    note = thin_band_note(nearly_all(prediction.upper - prediction.lower) / (top - bottom))
    add_head(figure, title, note=note)
    return figure


def _draw_measured(panel: Axes, frequency: Floats, measured: MeasuredFrf, floor: int) -> None:
    """Draw a floor's measurement below its prediction."""
    values = measured.log_frf[floor]
    valid = np.isfinite(values) if measured.valid is None else measured.valid[floor]
    used, unused = np.where(valid, values, np.nan), np.where(valid, np.nan, values)
    if not np.isfinite(values).any():
        panel.set_title("not measured", loc="right", color=QUIET, fontweight="normal")
        return
    panel.plot(frequency, np.exp(used), label="Measured", **MEASURED)
    if measured.noise_sd is not None:
        twice, label = 2.0 * measured.noise_sd[floor], "Measured, ±2 sd of its noise"
        low, high = np.exp(used - twice), np.exp(used + twice)
        panel.fill_between(frequency, low, high, label=label, zorder=0.9, **NOISE)
    if np.isfinite(unused).any():
        panel.plot(frequency, np.exp(unused), zorder=1.9, label="Measured, left out", **LEFT_OUT)
