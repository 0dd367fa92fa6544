"""Floor acceleration histories with their bands."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.report.figure import (
    add_head,
    checked,
    label_edges,
    nearly_all,
    new_figure,
    thin_band_note,
)
from femupdate.report.style import BAND, BLUE, FAINT, MEASURED, styled

ZOOM_SHARE = 0.12  # of the record, at most, in the panels on the right
ZOOM_CYCLES = 20  # there, at most


@styled
def floor_history_bands(
    time: ArrayLike,
    mean: ArrayLike,
    sd: ArrayLike,
    floors: Sequence[str],
    *,
    measured: ArrayLike | None = None,
    title: str = "Floor acceleration",
) -> Figure:
    """Draw the floor accelerations, the top floor first: the whole record and its strong part.

    Args:
        time: (n,) s.
        mean, sd: (f, n) over the posterior samples, m/s2; the band is two sd either way.
        floors: f names, bottom to top.
        measured: (f, n) m/s2 with rows of NaN where a floor has no sensor, or None.

    Raises:
        ReportError: an array has another shape.
    """
    instants = checked("time", time, None)
    shape = (len(floors), len(instants))
    middle, spread = checked("mean", mean, *shape), checked("sd", sd, *shape)
    seen = None if measured is None else checked("measured", measured, *shape)
    strong = strong_part(instants, middle[-1])
    figure = new_figure(11.5, 0.6 + 1.25 * len(floors))
    axes = figure.subplots(
        len(floors), 2, sharex="col", sharey=True, squeeze=False, width_ratios=(1.0, 1.15)
    )
    for (whole, zoomed), floor in zip(axes, reversed(range(len(floors))), strict=True):
        data = (middle[floor], spread[floor], None if seen is None else seen[floor])
        _draw_history(whole, instants, data, (instants[0], instants[-1]), zoomed=False)
        _draw_history(zoomed, instants, data, strong, zoomed=True)
        whole.axvspan(*strong, color=FAINT, alpha=0.55, linewidth=0.0, zorder=0)
        whole.set_title(floors[floor])
    digits = 1 if strong[1] - strong[0] > 2.0 else 2
    axes[0, 1].set_title(f"{strong[0]:.{digits}f} to {strong[1]:.{digits}f} s")
    label_edges(axes, axes.size, "Time, s", "m/s²")
    edges = np.abs(middle) + 2.0 * spread
    limits = symmetric_limits(edges, *([] if seen is None else [seen]))
    axes[0, 0].set_ylim(limits)
    add_head(figure, title, note=thin_band_note(2.0 * nearly_all(spread) / limits[1]))
    return figure


def strong_part(time: Floats, acceleration: Floats) -> tuple[float, float]:
    """Return the start and end, s, of some twenty strong cycles of a history, its peak inside."""
    strong = strongest(acceleration**2, max(2, round(ZOOM_SHARE * len(time))))
    crossings = np.count_nonzero(np.diff(np.sign(acceleration[strong])))
    length = (strong.stop - strong.start) * 2 * ZOOM_CYCLES / max(crossings, 2 * ZOOM_CYCLES)
    count = min(max(2, round(length)), len(time))
    peak = int(np.abs(acceleration).argmax())
    first, last = max(0, peak - count + 1), min(len(time), peak + count)
    shown = strongest(acceleration[first:last] ** 2, count)
    shown = slice(first + shown.start, first + shown.stop)
    return float(time[shown.start]), float(time[shown.stop - 1])


def strongest(power: Floats, length: int) -> slice:
    """The stretch of that many instants, or all where there are fewer, with most power."""
    length = min(length, len(power))
    energy = np.concatenate([[0.0], np.cumsum(power)])
    start = int(np.argmax(energy[length:] - energy[:-length]))
    return slice(start, start + length)


def _draw_history(
    panel: Axes,
    time: Floats,
    data: tuple[Floats, Floats, Floats | None],
    limits: tuple[float, float],
    *,
    zoomed: bool,
) -> None:
    """Draw one floor; what is zoomed is drawn thicker, and its labels go into the legend."""
    mean, sd, measured = data
    inside = (time >= limits[0]) & (time <= limits[1])
    t, middle, twice = time[inside], mean[inside], 2.0 * sd[inside]
    labels = ("Predicted, mean", "Predicted, mean ± 2 sd", "Measured") if zoomed else ("",) * 3
    panel.plot(t, middle, color=BLUE, linewidth=1.2 if zoomed else 0.6, label=labels[0])
    panel.fill_between(t, middle - twice, middle + twice, label=labels[1], **BAND)
    if measured is not None:
        look = {**MEASURED, "linewidth": 2.6 if zoomed else 1.2}
        panel.plot(t, measured[inside], label=labels[2], **look)
    panel.set_xlim(*limits)


def symmetric_limits(*values: Floats) -> tuple[float, float]:
    """Return limits, alike up and down, that hold all finite values with a little room."""
    tops = [np.nanmax(np.abs(v)) for v in values if np.isfinite(v).any()]
    top = 1.08 * (max(tops, default=0.0) or 1.0)
    return -top, top
