"""Bands over time or frequency: floor accelerations, floor spectra, forces of members."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report.figure import (
    add_head,
    frequency_ticks,
    label_edges,
    nearly_all,
    new_figure,
    panel_grid,
    thin_band_note,
)
from femupdate.report.scale import Scale, force_scale
from femupdate.report.style import BAND, BLUE, FAINT, MEASURED, QUIET, styled

ZOOM_SHARE = 0.12  # of the record, at most, in the panels on the right
ZOOM_CYCLES = 20  # there, at most

_LABELS = (
    "Predicted, mean",
    "Predicted, mean ± 2 sd",
    "Of the parameters alone",
    "Measured",
)


class History(NamedTuple):
    """What is drawn of one floor, (n,) each: in a band, and the parameters' own mean and sd."""

    mean: Floats
    sd: Floats
    measured: Floats | None
    alone: tuple[Floats, Floats] | None


@styled
def floor_history_bands(
    time: Floats,
    mean: Floats,
    sd: Floats,
    floors: Sequence[str],
    *,
    alone: tuple[Floats, Floats] | None = None,
    measured: Floats | None = None,
    title: str = "Floor acceleration",
) -> Figure:
    """Draw the floor accelerations, the top floor first: the whole record and its strong part.

    Args:
        time: (n,) s.
        mean, sd: (f, n) over the posterior samples, m/s2; the band is two sd either way.
        floors: f names, bottom to top.
        alone: mean and sd (f, n) of the parameters alone, m/s2, drawn as a band inside.
        measured: (f, n) m/s2 with rows of NaN where a floor has no sensor, or None.
    """
    strong = strong_part(time, mean[-1])
    figure = new_figure(11.5, 0.6 + 1.25 * len(floors))
    axes = figure.subplots(
        len(floors), 2, sharex="col", sharey=True, squeeze=False, width_ratios=(1.0, 1.15)
    )
    for (whole, zoomed), floor in zip(axes, reversed(range(len(floors))), strict=True):
        data = History(
            mean[floor],
            sd[floor],
            None if measured is None else measured[floor],
            None if alone is None else (alone[0][floor], alone[1][floor]),
        )
        _draw_history(whole, time, data, (time[0], time[-1]), zoomed=False)
        _draw_history(zoomed, time, data, strong, zoomed=True)
        whole.axvspan(*strong, color=FAINT, alpha=0.55, linewidth=0.0, zorder=0)
        whole.set_title(floors[floor])
    digits = 1 if strong[1] - strong[0] > 2.0 else 2
    axes[0, 1].set_title(f"{strong[0]:.{digits}f} to {strong[1]:.{digits}f} s")
    label_edges(axes, axes.size, "Time, s", "m/s²")
    edges = np.abs(mean) + 2.0 * sd
    limits = symmetric_limits(edges, *([] if measured is None else [measured]))
    axes[0, 0].set_ylim(limits)
    add_head(figure, title, note=thin_band_note(2.0 * nearly_all(sd) / limits[1]))
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
    data: History,
    limits: tuple[float, float],
    *,
    zoomed: bool,
) -> None:
    """Draw one floor; what is zoomed is drawn thicker, and its labels go into the legend."""
    inside = (time >= limits[0]) & (time <= limits[1])
    t, middle, twice = time[inside], data.mean[inside], 2.0 * data.sd[inside]
    labels = _LABELS if zoomed else ("",) * len(_LABELS)
    panel.plot(t, middle, color=BLUE, linewidth=1.2 if zoomed else 0.6, label=labels[0])
    panel.fill_between(t, middle - twice, middle + twice, label=labels[1], **BAND)
    if data.alone is not None:
        centre, narrow = data.alone[0][inside], 2.0 * data.alone[1][inside]
        look = {**BAND, "alpha": 0.5}
        panel.fill_between(t, centre - narrow, centre + narrow, label=labels[2], **look)
    if data.measured is not None:
        look = {**MEASURED, "linewidth": 2.6 if zoomed else 1.2}
        panel.plot(t, data.measured[inside], label=labels[3], **look)
    panel.set_xlim(*limits)


def symmetric_limits(*values: Floats) -> tuple[float, float]:
    """Return limits, alike up and down, that hold all finite values with a little room."""
    tops = [np.nanmax(np.abs(v)) for v in values if np.isfinite(v).any()]
    top = 1.08 * (max(tops, default=0.0) or 1.0)
    return -top, top


@styled
def floor_spectra_bands(
    frequency_hz: Floats,
    mean: Floats,
    sd: Floats,
    floors: Sequence[str],
    *,
    base: Floats,
    title: str = "Floor response spectra",
) -> Figure:
    """Draw the spectrum of every floor over that of the ground motion, the top floor first.

    Args:
        frequency_hz: (k,) of the oscillators, ascending.
        mean, sd: (f, k) over the posterior samples, m/s2; the band is two sd either way.
        floors: f names, bottom to top.
        base: (k,) spectrum of the ground motion, m/s2.
    """
    size, columns = (3.6, 2.5), min(3, len(floors))
    figure, panels = panel_grid(len(floors), columns, size, "Oscillator, Hz", "Acceleration, m/s²")
    for panel, floor in zip(panels, reversed(range(len(floors))), strict=True):
        low, high = mean[floor] - 2 * sd[floor], mean[floor] + 2 * sd[floor]
        panel.plot(frequency_hz, mean[floor], color=BLUE, label="Floor, mean")
        panel.fill_between(frequency_hz, low, high, label="Mean ± 2 sd", **BAND)
        panel.plot(frequency_hz, base, color=QUIET, linestyle="--", label="Ground")
        panel.set_title(floors[floor])
    frequency_ticks(panels[0], frequency_hz[0], frequency_hz[-1])
    panels[0].set_ylim(0.0, 1.08 * max((mean + 2 * sd).max(), base.max()))
    add_head(figure, title)
    return figure


MemberHistories = tuple[str, Sequence[str], Floats, Floats]


@styled
def member_force_bands(
    time: Floats,
    members: Sequence[MemberHistories],
    *,
    title: str = "Forces of members",
    note: str = "",
) -> Figure:
    """Draw a row of panels for every member, in the strong part of the motion.

    Args:
        time: (n,) s.
        members: of each its name, the names of its three forces (normal force, shear, moment), and
            their mean and standard deviation (3, n), N and N m; the band is two sd either way.
        note: under the title.
    """
    start, end = strong_part(time, members[0][2][1])
    shown = (time >= start) & (time <= end)
    scales, shares = _scales(members), []
    figure = new_figure(11.5, 0.5 + 2.0 * len(members))
    axes = figure.subplots(len(members), 3, sharex=True, squeeze=False)
    for row, (name, forces, mean, sd) in zip(axes, members, strict=True):
        for panel, force, one, two in zip(row, forces, mean, sd, strict=True):
            scale = scales[force.startswith("M")]
            _draw(panel, time[shown], one[shown], 2.0 * two[shown], force, scale)
            low, high = panel.get_ylim()
            shares.append(4.0 * two[shown] / scale.factor / (high - low))
        row[0].set_title(name, loc="left")
    for panel in axes[-1]:
        panel.set_xlabel("Time, s")
    thin = thin_band_note(nearly_all(shares))
    add_head(figure, title, note="\n".join(one for one in (note, thin) if one))
    return figure


def _scales(members: Sequence[MemberHistories]) -> tuple[Scale, Scale]:
    """One unit for the forces and one for the moments of all members."""
    largest = [0.0, 0.0]
    for _, forces, mean, sd in members:
        tops = (np.abs(mean) + 2.0 * sd).max(axis=1)
        for force, top in zip(forces, tops, strict=True):
            moment = force.startswith("M")
            largest[moment] = max(largest[moment], float(top))
    return force_scale(largest[0]), force_scale(largest[1])


def _draw(panel: Axes, time: Floats, mean: Floats, band: Floats, force: str, scale: Scale) -> None:
    low, high = (mean - band) / scale.factor, (mean + band) / scale.factor
    panel.plot(time, mean / scale.factor, color=BLUE, linewidth=1.0, label="Mean")
    panel.fill_between(time, low, high, label="Mean ± 2 sd", **BAND)
    unit = f"{scale.unit} m" if force.startswith("M") else scale.unit
    panel.set_ylabel(f"{force.replace('_', ' ')}, {unit}")
    panel.set_xlim(time[0], time[-1])
