"""Curves with their bands as pictures: responses, floor motions, forces; shear over drift."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from femupdate.arrays import Floats
from femupdate.report.curves import LEFT_OUT, MEASURED, Curve
from femupdate.report.figure import (
    BAND,
    BLUE,
    FAINT,
    INK,
    QUIET,
    add_head,
    frequency_ticks,
    label_edges,
    labelled,
    nearly_all,
    new_figure,
    panel_grid,
    styled,
    thin_band_note,
)
from femupdate.report.figure import MEASURED as WIDE
from femupdate.report.scale import Scale, force_scale, interval_text, length_scale
from femupdate.units import capital

ZOOM_CYCLES = 20  # there, at most

_NOISE: dict[str, Any] = {"color": QUIET, "alpha": 0.28, "linewidth": 0.0, "zorder": 0.9}
_UNUSED: dict[str, Any] = {
    "color": QUIET,
    "linewidth": 1.0,
    "linestyle": (0, (1, 1.5)),
    "zorder": 1.9,
}


def draw_curve(panel: Axes, curve: Curve, line: float = 1.0, measured: float = 2.6) -> None:
    """Draw a mean over its bands and what was measured, of such widths, with labels."""
    x, inner = curve.x, len(curve.bands) - 1
    panel.plot(x, curve.mean, color=BLUE, linewidth=line, label=capital(curve.name))
    for number, band in enumerate(curve.bands):
        look = {**BAND, "alpha": 0.5} if number == inner > 0 else BAND
        panel.fill_between(x, band.low, band.high, label=capital(band.name), **look)
    used, unused = curve.seen(used=True), curve.seen(used=False)
    if used is not None:
        panel.plot(x, used, label=capital(MEASURED), **{**WIDE, "linewidth": measured})
        if curve.noise is not None:
            wide, label = np.exp(2.0 * curve.noise), "Measured, ±2 sd of its noise"
            panel.fill_between(x, used / wide, used * wide, label=label, **_NOISE)
    if unused is not None:
        panel.plot(x, unused, label=capital(LEFT_OUT), **_UNUSED)
    if curve.beside is not None:
        panel.plot(x, curve.beside, color=QUIET, linestyle="--", label="Ground")


def _grid(
    curves: Sequence[Curve], columns: int, size: tuple[float, float], line: float
) -> tuple[Figure, list[Axes]]:
    """A panel for every curve, with its title."""
    across, up = capital(curves[0].across), capital(curves[0].up)
    figure, panels = panel_grid(len(curves), columns, size, across, up)
    for panel, curve in zip(panels, curves, strict=True):
        draw_curve(panel, curve, line)
        panel.set_title(curve.title)
    return figure, panels


@styled
def frf_fit(curves: Sequence[Curve]) -> Figure:
    """Draw |H| of every floor as `response_curves` describes it."""
    columns, width = (1, 10.0) if len(curves) == 1 else (2, 5.0)
    first = curves[0]
    figure, panels = _grid(curves, columns, (width, 1.95), 1.0)
    for panel, curve in zip(panels, curves, strict=True):
        if curve.measured is None or not np.isfinite(curve.measured).any():
            panel.set_title("not measured", loc="right", color=QUIET, fontweight="normal")
    start = 0.0 if first.x[0] < 0.05 * first.x[-1] else first.x[0]
    panels[0].set(yscale="log", xlim=(start, first.x[-1]))
    bottom, top = (np.log(limit) for limit in panels[0].get_ylim())
    inner = [np.log(curve.bands[-1].high / curve.bands[-1].low) for curve in curves]
    several = len(first.bands) > 1
    which = "The dark bands" if several else "The bands"
    note = thin_band_note(nearly_all(inner) / (top - bottom), which)
    add_head(figure, "Frequency response, floor over base", note=note, columns=3 * several or None)
    return figure


@styled
def floor_history_bands(curves: Sequence[Curve], *, title: str = "Floor acceleration") -> Figure:
    """Draw floors as `history_curves` describes them: the whole record and its strong part."""
    time, count = curves[0].x, len(curves)
    strong = strong_part(time, curves[0].mean)
    inside = (time >= strong[0]) & (time <= strong[1])
    figure = new_figure(11.5, 0.6 + 1.25 * count)
    axes = figure.subplots(
        count, 2, sharex="col", sharey=True, squeeze=False, width_ratios=(1.0, 1.15)
    )
    for (whole, zoomed), curve in zip(axes, curves, strict=True):
        draw_curve(whole, curve, 0.6, 1.2)
        draw_curve(zoomed, curve.at(inside), 1.2)
        whole.axvspan(*strong, color=FAINT, alpha=0.55, linewidth=0.0, zorder=0)
        whole.set_title(curve.title)
    axes[0, 0].set_xlim(time[0], time[-1])
    axes[0, 1].set_xlim(*strong)
    digits = 1 if strong[1] - strong[0] > 2.0 else 2
    axes[0, 1].set_title(f"{strong[0]:.{digits}f} to {strong[1]:.{digits}f} s")
    label_edges(axes, axes.size, capital(curves[0].across), "m/s²")
    edges = [edge for curve in curves for band in curve.bands for edge in (band.low, band.high)]
    measured = [curve.measured for curve in curves if curve.measured is not None]
    limits = symmetric_limits(*edges, *measured)
    axes[0, 0].set_ylim(limits)
    widths = [curve.bands[0].high - curve.bands[0].low for curve in curves]
    note = thin_band_note(0.5 * nearly_all(widths) / limits[1])
    add_head(figure, title, labelled(axes[:, 1]), note=note)
    return figure


def strong_part(time: Floats, acceleration: Floats) -> tuple[float, float]:
    """Return the start and end, s, of some twenty strong cycles of a history, its peak inside."""
    # The panels on the right show an eighth of the record at most.
    strong = strongest(acceleration**2, max(2, round(0.12 * len(time))))
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


def symmetric_limits(*values: Floats) -> tuple[float, float]:
    """Return limits, alike up and down, that hold all finite values with a little room."""
    tops = [np.nanmax(np.abs(v)) for v in values if np.isfinite(v).any()]
    top = 1.08 * (max(tops, default=0.0) or 1.0)
    return -top, top


@styled
def floor_spectra_bands(
    curves: Sequence[Curve], *, title: str = "Floor response spectra"
) -> Figure:
    """Draw the spectrum of every floor as `spectrum_curves` describes it."""
    figure, panels = _grid(curves, min(3, len(curves)), (3.6, 2.5), 1.3)
    frequency_ticks(panels[0], curves[0].x[0], curves[0].x[-1])
    tops = [band.high for shown in curves for band in shown.bands]
    tops += [shown.beside for shown in curves if shown.beside is not None]
    panels[0].set_ylim(0.0, 1.08 * np.max(tops))
    add_head(figure, title)
    return figure


@styled
def member_force_bands(
    members: Sequence[tuple[str, Sequence[Curve]]],
    *,
    title: str = "Forces of members",
    note: str = "",
) -> Figure:
    """Draw a row of panels for every member, in the strong part of the motion.

    Args:
        members: of each its name, and the histories of its normal force, shear and moment.
    """
    time, shear = members[0][1][1].x, members[0][1][1].mean
    start, end = strong_part(time, shear)
    shown, shares = (time >= start) & (time <= end), []
    figure = new_figure(11.5, 0.5 + 2.0 * len(members))
    axes = figure.subplots(len(members), len(members[0][1]), sharex=True, squeeze=False)
    for row, (name, curves) in zip(axes, members, strict=True):
        for panel, curve in zip(row, curves, strict=True):
            draw_curve(panel, drawn := curve.at(shown))
            panel.set(ylabel=capital(curve.up), xlim=(drawn.x[0], drawn.x[-1]))
            low, high = panel.get_ylim()
            shares += [(band.high - band.low) / (high - low) for band in drawn.bands]
        row[0].set_title(name, loc="left")
    for panel in axes[-1]:
        panel.set_xlabel(capital(members[0][1][0].across))
    thin = thin_band_note(nearly_all(shares))
    add_head(figure, title, note="\n".join(words for words in (note, thin) if words))
    return figure


LINES = 100  # samples drawn
POINTS = 1200  # instants drawn of each


@styled
def story_shear_drift(
    shear: Floats, drift: Floats, stiffness: Floats, stories: Sequence[str]
) -> Figure:
    """Draw shear against drift of every story, the top story first, with its mean stiffness.

    Up to 100 samples are drawn, each in the stretch of the record in which it drifts most.

    Args:
        shear: (S, s, n) N.
        drift: (S, s, n) m.
        stiffness: (S', s) N/m of all samples: mean slope and 5 to 95 % interval.
        stories: s names, the lowest first.
    """
    # The stretch with most drift, summed over stories each by its size.
    power = np.einsum("ksn,ksn->sn", drift, drift)
    power /= np.maximum(power.max(axis=1, keepdims=True), 1e-300)
    count, part = len(stories), strongest(power.sum(axis=0), POINTS)
    forces, drifts = shear[:LINES, :, part], drift[:LINES, :, part]
    force, length = force_scale(forces), length_scale(drifts)
    columns = min(count, 2 if count <= 4 else 3)
    across, up = f"Drift, {length.unit}", f"Shear, {force.unit}"
    figure, panels = panel_grid(count, columns, (3.6, 2.75), across, up)
    for panel, story in zip(panels, reversed(range(count)), strict=True):
        lines = np.stack([drifts[:, story] / length.factor, forces[:, story] / force.factor], -1)
        _draw_story(panel, lines, stiffness[:, story], force, length)
        panel.set_title(f"Story {stories[story]}")
    panels[0].set_ylim(symmetric_limits(forces / force.factor))
    panels[0].set_xlim(symmetric_limits(drifts / length.factor))
    panels[0].xaxis.set_major_locator(MaxNLocator(5))
    shown = "1 posterior sample" if len(forces) == 1 else f"{len(forces)} posterior samples"
    mean = Line2D([], [], color=INK, linestyle="--", label="Mean stiffness [5, 95 %]")
    add_head(
        figure, "Story shear against story drift", [Line2D([], [], color=BLUE, label=shown), mean]
    )
    return figure


def _draw_story(panel: Axes, lines: Floats, stiffness: Floats, force: Scale, length: Scale) -> None:
    """Lines (S, n, 2) of drift and shear as shown, and the mean slope across the panel."""
    alpha = min(0.6, 6.0 / len(lines) + 0.06)
    panel.add_collection(LineCollection(list(lines), colors=BLUE, linewidths=0.5, alpha=alpha))
    shown = stiffness * length.factor / force.factor
    panel.axline((0.0, 0.0), slope=shown.mean(), color=INK, linewidth=1.1, linestyle="--")
    low, high = np.quantile(shown, [0.05, 0.95])
    unit = f"{force.unit}/{length.unit}"
    text = interval_text(shown.mean(), shown.std(), low, high).replace(" [", f" {unit}\n[")
    look: dict[str, Any] = {"ha": "right", "va": "bottom", "fontsize": 8.5}
    panel.text(0.97, 0.05, text, transform=panel.transAxes, **look)
