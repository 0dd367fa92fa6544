"""What is in a measured file: histories, spectra, response to the base and its coherence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from femupdate.arrays import Floats
from femupdate.report.figure import add_head, frequency_ticks, new_figure
from femupdate.report.page_charts import thinned
from femupdate.report.style import hue, look, styled

MOST_LINES = 24
SEGMENTS = 16  # of Welch's method, half overlapping
_MOST_LETTERS = 80  # of the names below an axis
_FEW_TICKS = 5  # in a narrow panel
POINTS = 4000  # of a history drawn, as the extremes of short stretches


@dataclass(frozen=True, eq=False)
class MeasuredLine:
    """One history to draw.

    Attributes:
        label: what it is.
        values: (n,) in any unit.
        time_step: s.
        base: whether the others respond to it, or None of those that respond to none. A force
            stands for the base where there is one.
    """

    label: str
    values: Floats
    time_step: float
    base: bool | None = None


@styled
def measured_histories(
    lines: Sequence[MeasuredLine], title: str, unit: str, over_force: str = ""
) -> Figure:
    """Draw histories one above the other, their spectra, and the response to the base.

    Args:
        lines: of the file; the first `MOST_LINES` are drawn.
        unit: of the histories.
        over_force: unit of the responses where the others respond to a force.
    """
    drawn = lines[:MOST_LINES]
    base = next((each for each in drawn if each.base), None)
    floors = [k for k, each in enumerate(drawn) if each.base is False and _beside(base, each)]
    compared = base is not None and bool(floors)
    figure = new_figure(13.0, 2.6 + 0.3 * len(drawn) + (1.6 if compared else 0.0))
    grid = figure.add_gridspec(2 if compared else 1, 5)
    _draw_histories(figure.add_subplot(grid[:, :3]), drawn)
    _draw_spectra(figure.add_subplot(grid[0, 3:]), drawn, unit)
    if base is not None and compared:
        response, share = figure.add_subplot(grid[1, 3]), figure.add_subplot(grid[1, 4])
        _draw_response(response, share, base, {k: drawn[k] for k in floors})
        response.set(ylabel="|H|", title="Floor over base")
        if over_force:
            response.set(ylabel=f"|H|, {over_force}", title="Response to the force")
    left_out = len(lines) - len(drawn)
    note = f"{left_out} more channels are not drawn." if left_out else ""
    handles = [Line2D([], [], label=each.label, **look(k)) for k, each in enumerate(drawn)]
    add_head(figure, title, handles, columns=8, note=note)
    return figure


@styled
def measured_functions(curves: Sequence[tuple[str, Floats, Any]], title: str, unit: str) -> Figure:
    """Draw the size of functions of frequency.

    Args:
        curves: label, frequencies (m,) in Hz, values (m,).
    """
    figure = new_figure(9.0, 4.0)
    axes = figure.add_subplot()
    for k, (_, frequency, values) in enumerate(curves[:MOST_LINES]):
        size = np.abs(values)
        # A zero, as a spectrum may have at 0 Hz, is no value to draw to.
        axes.semilogy(frequency, np.where(size > 0.0, size, np.nan), **look(k))
    axes.set(xlabel="Frequency, Hz", ylabel=unit)
    handles = [
        Line2D([], [], label=label, **look(k)) for k, (label, *_) in enumerate(curves[:MOST_LINES])
    ]
    add_head(figure, title, handles, columns=4)
    return figure


@dataclass(frozen=True, eq=False)
class MeasuredMode:
    """A mode to draw.

    Attributes:
        frequency_hz: natural frequency.
        damping: ratio of critical damping, or None.
        shape: (s,) components, NaN where one is missing.
        sensors: (s,) their names.
    """

    frequency_hz: float
    damping: float | None
    shape: Any
    sensors: tuple[str, ...] = ()


@styled
def measured_modes(modes: Sequence[MeasuredMode], title: str) -> Figure:
    """Draw the shapes of identified modes, the real part of their components point by point.

    Of modes without shapes the damping ratios over the frequencies.

    Args:
        modes: of the file; the first `MOST_LINES` are drawn.
    """
    figure = new_figure(9.0, 4.0)
    axes = figure.add_subplot()
    shown = modes[:MOST_LINES]
    handles = [
        Line2D([], [], label=f"{one.frequency_hz:.4g} Hz", **look(k)) for k, one in enumerate(shown)
    ]
    add_head(figure, title, handles, columns=4)
    if not any(np.size(one.shape) for one in shown):
        _draw_ratios(axes, shown)
        return figure
    for k, one in enumerate(shown):
        values = np.real(one.shape)
        largest = np.nanmax(np.abs(values), initial=1e-300)
        axes.plot(values / largest, marker="o", ms=3, **look(k))
    axes.set(xlabel="Component, point by point", ylabel="Shape over its largest component")
    names = shown[0].sensors
    alike = all(one.sensors == names for one in shown)
    if alike and sum(map(len, names)) <= _MOST_LETTERS:
        axes.set_xticks(range(len(names)), names)
        axes.set_xlabel("")
    return figure


def _draw_ratios(axes: Axes, modes: Sequence[MeasuredMode]) -> None:
    for k, one in enumerate(modes):
        ratio = 100.0 * (one.damping or 0.0)
        axes.plot([one.frequency_hz] * 2, [0.0, ratio], "o-", ms=5, color=hue(k))
    axes.set(xlabel="Frequency, Hz", ylabel="Damping ratio, %", ylim=(0.0, None))
    axes.set_xlim(0.0, 1.1 * max(one.frequency_hz for one in modes))


def _draw_histories(axes: Axes, lines: Sequence[MeasuredLine]) -> None:
    # So that neighbours do not overlap, whatever their peaks.
    spacing = 2.0 * max(float(np.abs(each.values - each.values.mean()).max()) for each in lines)
    spacing = spacing or 1.0
    for k, each in enumerate(lines):
        kept = thinned(each.values, POINTS)
        height = each.values[kept] - each.values.mean() - k * spacing
        axes.plot(kept * each.time_step, height, color=hue(k), linewidth=0.6)
    axes.set_yticks([-k * spacing for k in range(len(lines))], [each.label for each in lines])
    for k, label in enumerate(axes.get_yticklabels()):
        label.set_color(hue(k))
    axes.set(xlabel="Time, s", title="Histories, to one scale, about their means")
    axes.grid(axis="y", visible=False)


def _draw_spectra(axes: Axes, lines: Sequence[MeasuredLine], unit: str) -> None:
    from scipy.signal import welch

    top = 1e-300
    for k, each in enumerate(lines):
        frequency, power = welch(each.values, 1.0 / each.time_step, nperseg=_segment(each))
        axes.loglog(frequency[1:], np.sqrt(power[1:]) + 1e-300, **look(k), linewidth=0.9)
        top = max(top, float(np.sqrt(power[1:].max(initial=0.0))))
    axes.set_ylim(top * 1e-5, top * 2.0)
    longest = max(each.time_step * _segment(each) for each in lines)
    frequency_ticks(axes, 1.0 / longest, 0.5 / min(each.time_step for each in lines))
    axes.set(xlabel="Frequency, Hz", ylabel=f"{unit} per √Hz", title="Spectra")


def _draw_response(
    response: Axes, share: Axes, base: MeasuredLine, floors: Mapping[int, MeasuredLine]
) -> None:
    from scipy.signal import coherence, csd, welch

    options = {"fs": 1.0 / base.time_step, "nperseg": _segment(base)}
    frequency, power = welch(base.values, **options)
    # Where the base has no power, leakage alone would make a response.
    shown = (frequency > 0.0) & (power > 1e-5 * power.max())
    for k, each in floors.items():
        cross = csd(base.values, each.values, **options)[1]
        size = np.abs(cross[shown]) / power[shown]
        response.loglog(frequency[shown], size + 1e-300, **look(k), linewidth=0.9)
        seen = coherence(base.values, each.values, **options)[1]
        share.semilogx(frequency[shown], seen[shown], **look(k), linewidth=0.9)
    for axes in (response, share):
        frequency_ticks(axes, float(frequency[1]), float(frequency[-1]), _FEW_TICKS)
    response.set(xlabel="Frequency, Hz")
    share.set(xlabel="Frequency, Hz", ylim=(0.0, 1.02), title="Coherence")


def _beside(base: MeasuredLine | None, line: MeasuredLine) -> bool:
    """Whether a floor was sampled at the times of the base."""
    same = base is not None and base.values.size == line.values.size
    return same and base is not None and base.time_step == line.time_step


def _segment(line: MeasuredLine) -> int:
    return max(2 * line.values.size // (SEGMENTS + 1), 2)
