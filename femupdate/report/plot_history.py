"""Floor acceleration histories with their bands, and story shear against story drift."""

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.errors import ReportError
from femupdate.report.figure import (
    add_head,
    checked,
    label_edges,
    new_figure,
)
from femupdate.report.scale import Scale, force_scale, length_scale, three_figures
from femupdate.report.style import BLUE, FAINT, INK, styled

BAND: dict[str, Any] = {"color": BLUE, "alpha": 0.3, "linewidth": 0.0}
MEASURED: dict[str, Any] = {"color": INK, "linewidth": 0.9}
BEHIND: dict[str, Any] = {"linewidth": 0.5, "zorder": 1.5}
BEFORE: dict[str, Any] = {"linestyle": "--", "zorder": 2.5}
ZOOM_SHARE = 0.12  # of the record, at most, in the panels on the right
ZOOM_CYCLES = 20  # there, at most
LINES = 100  # samples drawn
POINTS = 1200  # instants drawn of each


@styled
def floor_history_bands(
    time: ArrayLike,
    mean: ArrayLike,
    sd: ArrayLike,
    floors: Sequence[str],
    *,
    measured: ArrayLike | None = None,
    window: tuple[float, float] | None = None,
    title: str = "Floor acceleration",
) -> Figure:
    """Draw the floor accelerations, the top floor first: the whole record and its strong part.

    Args:
        time: (n,) s.
        mean, sd: (f, n) over the posterior samples, m/s2; the band is two sd either way.
        floors: f names, bottom to top.
        measured: (f, n) m/s2 with rows of NaN where a floor has no sensor, or None.
        window: start and end of the strong part, s; default where the top floor shakes most.
        title: over the figure.

    Raises:
        ReportError: an array has another shape, or the window lies outside the record.
    """
    instants = checked("time", time, None)
    shape = (len(floors), len(instants))
    middle, spread = checked("mean", mean, *shape), checked("sd", sd, *shape)
    seen = None if measured is None else checked("measured", measured, *shape)
    strong = strong_part(instants, middle[-1]) if window is None else window
    if not instants[0] <= strong[0] < strong[1] <= instants[-1]:
        raise ReportError(
            f"the window {strong[0]} to {strong[1]} s lies outside the record, "
            f"{instants[0]} to {instants[-1]} s"
        )
    digits = 1 if strong[1] - strong[0] > 2.0 else 2
    figure = new_figure(11.5, 0.6 + 1.25 * len(floors))
    axes = figure.subplots(
        len(floors), 2, sharex="col", sharey=True, squeeze=False, width_ratios=(1.0, 1.15)
    )
    for row, floor in enumerate(reversed(range(len(floors)))):
        data = (middle[floor], spread[floor], None if seen is None else seen[floor])
        for panel, limits in zip(axes[row], ((instants[0], instants[-1]), strong), strict=True):
            _draw_history(panel, instants, data, limits)
        axes[row, 0].axvspan(*strong, color=FAINT, alpha=0.55, linewidth=0.0, zorder=0)
        axes[row, 0].set_title(floors[floor])
    axes[0, 1].set_title("{:.{digits}f} to {:.{digits}f} s".format(*strong, digits=digits))
    label_edges(axes, axes.size, "Time (s)", "m/s²")
    edges = np.abs(middle) + 2.0 * spread
    axes[0, 0].set_ylim(_around(edges, *([] if seen is None else [seen])))
    add_head(figure, title, _history_handles(seen is not None))
    return figure


def strong_part(time: Floats, acceleration: Floats) -> tuple[float, float]:
    """Return the start and end, s, of the strongest twenty cycles or so of a history."""
    strong = _strongest(acceleration**2, max(2, round(ZOOM_SHARE * len(time))))
    crossings = np.count_nonzero(np.diff(np.sign(acceleration[strong])))
    length = (strong.stop - strong.start) * 2 * ZOOM_CYCLES / max(crossings, 2 * ZOOM_CYCLES)
    shown = _strongest(acceleration**2, max(2, round(length)))
    return float(time[shown.start]), float(time[shown.stop - 1])


def _strongest(power: Floats, length: int) -> slice:
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
) -> None:
    mean, sd, measured = data
    inside = (time >= limits[0]) & (time <= limits[1])
    t, middle, twice = time[inside], mean[inside], 2.0 * sd[inside]
    panel.fill_between(t, middle - twice, middle + twice, **BAND)
    whole = inside.all()
    if measured is not None:  # behind the prediction where there is no room to see both
        style: dict[str, Any] = (
            {"linewidth": 0.5, "zorder": 1.5} if whole else {"linestyle": "--", "zorder": 2.5}
        )
        panel.plot(t, measured[inside], **MEASURED | style)
    panel.plot(t, middle, color=BLUE, linewidth=0.6 if whole else 1.2)
    panel.set_xlim(*limits)


def _around(*values: Floats) -> tuple[float, float]:
    """Limits alike up and down that hold all values with a little room; NaN counts for nothing."""
    tops = [np.nanmax(np.abs(v)) for v in values if np.isfinite(v).any()]
    top = 1.08 * (max(tops, default=0.0) or 1.0)
    return -top, top


def _history_handles(measured: bool) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=BLUE, label="Predicted, mean"),
        Patch(label="Predicted, mean ± 2 sd", **BAND),
    ]
    if measured:
        handles.append(Line2D([], [], linestyle="--", label="Measured", **MEASURED))
    return handles


@styled
def story_shear_drift(
    shear: ArrayLike,
    drift: ArrayLike,
    stiffness: ArrayLike,
    *,
    title: str = "Story shear against story drift",
) -> Figure:
    """Draw shear against drift of every story, the top story first, with its mean stiffness.

    Up to 100 samples are drawn, each in the stretch of the record in which it drifts most.

    Args:
        shear: (S, s, n) N.
        drift: (S, s, n) m.
        stiffness: (S', s) N/m of all samples: mean slope and 5 to 95 % interval.
        title: over the figure.

    Raises:
        ReportError: an array has another shape.
    """
    forces = checked("shear", shear, None, None, None)
    count = forces.shape[1]
    drifts = checked("drift", drift, *forces.shape)
    slopes = checked("stiffness", stiffness, None, count)
    if not len(forces) or not len(slopes):
        raise ReportError("shear and stiffness hold no sample; give one at least")
    part = _most_drift(drifts)
    forces, drifts = forces[:LINES, :, part], drifts[:LINES, :, part]
    scales = force_scale(forces), length_scale(drifts)
    columns = min(count, 2 if count <= 4 else 3)
    rows = ceil(count / columns)
    figure = new_figure(3.6 * columns + 0.4, 2.75 * rows + 0.3)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for place, story in enumerate(reversed(range(count))):
        lines = np.stack([drifts[:, story] / scales[1].factor, forces[:, story] / scales[0].factor])
        _draw_story(axes.flat[place], lines, slopes[:, story], scales)
        axes.flat[place].set_title(f"Story {story + 1}")
    axes[0, 0].set_ylim(_around(forces / scales[0].factor))
    axes[0, 0].set_xlim(_around(drifts / scales[1].factor))
    axes[0, 0].xaxis.set_major_locator(MaxNLocator(5))
    label_edges(axes, count, f"Drift ({scales[1].unit})", f"Shear ({scales[0].unit})")
    shown = "1 posterior sample" if len(forces) == 1 else f"{len(forces)} posterior samples"
    add_head(figure, title, _story_handles(shown))
    return figure


def _most_drift(drift: Floats) -> slice:
    """The stretch of POINTS instants with most drift, summed over stories each by its size."""
    power = np.einsum("ksn,ksn->sn", drift, drift)
    power /= np.maximum(power.max(axis=1, keepdims=True), 1e-300)
    return _strongest(power.sum(axis=0), POINTS)


def _draw_story(panel: Axes, lines: Floats, stiffness: Floats, scales: tuple[Scale, Scale]) -> None:
    """Lines (2, S, n) of drift and shear as shown, and the mean slope across the panel."""
    curves = LineCollection(
        list(np.moveaxis(lines, 0, -1)),
        colors=BLUE,
        linewidths=0.5,
        alpha=min(0.6, 6.0 / len(lines[0]) + 0.06),
    )
    panel.add_collection(curves)
    force, length = scales
    shown = stiffness * length.factor / force.factor
    panel.axline((0.0, 0.0), slope=shown.mean(), color=INK, linewidth=1.1, linestyle="--")
    low, high = np.quantile(shown, [0.05, 0.95])
    unit = f"{force.unit}/{length.unit}"
    panel.annotate(
        f"{three_figures(shown.mean())} {unit}\n[{three_figures(low)}, {three_figures(high)}]",
        (0.97, 0.05),
        xycoords="axes fraction",
        ha="right",
        va="bottom",
        fontsize=8.5,
    )


def _story_handles(samples: str) -> list[Line2D]:
    return [
        Line2D([], [], color=BLUE, label=samples),
        Line2D([], [], color=INK, linestyle="--", label="Mean stiffness [5, 95 %]"),
    ]
