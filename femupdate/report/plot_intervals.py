"""Intervals in rows: parameters from prior to posterior, frequencies of the modes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.errors import ReportError
from femupdate.report.figure import add_head, checked, new_figure
from femupdate.report.plot_posterior import Case, SampleSet, checked_cases
from femupdate.report.style import BLUE, FAINT, INK, QUIET, SKY, styled

ROW_HEIGHT = 0.26  # inches for each interval
BETWEEN_ROWS = 0.2
PRIOR: dict[str, Any] = {"color": FAINT, "solid_capstyle": "butt"}
MEASURED: dict[str, Any] = {
    "color": INK,
    "linestyle": "",
    "marker": "|",
    "markersize": 17.0,
    "mew": 1.6,
}


@styled
def theta_intervals(
    names: Sequence[str],
    sets: Sequence[SampleSet],
    bounds: ArrayLike,
    truth: ArrayLike | None = None,
    *,
    title: str = "Stiffness factors, from prior to posterior",
) -> Figure:
    """Draw each parameter's prior range and its 5 to 95 % interval in every set of samples.

    Args:
        names: p names; the first is drawn lowest, as the first story is.
        sets: one to six posteriors.
        bounds: (p, 2) prior bounds.
        truth: (p,) true values, where they are known.
        title: over the figure.

    Raises:
        ReportError: an array has another shape, or there are no samples or too many sets.
    """
    cases = checked_cases(sets, len(names))
    limits = checked("bounds", bounds, len(names), 2)
    true = None if truth is None else checked("truth", truth, len(names))
    band = ROW_HEIGHT * len(cases) + BETWEEN_ROWS
    texts = [_template(case.samples) for case in cases]
    figure = new_figure(8.5, 0.75 + band * len(names))
    panel = figure.subplots()
    for row, (low, high) in enumerate(limits):
        panel.plot([low, high], [row, row], linewidth=58.0 * (band - 0.14), **PRIOR)
        for place, case in enumerate(cases):
            height = row + ((len(cases) - 1) / 2 - place) * ROW_HEIGHT / band
            _draw_interval(panel, case.samples[:, row], height, case.color, texts[place])
        if true is not None:
            half = 0.36
            panel.plot([true[row]] * 2, [row - half, row + half], color=INK, linestyle="--")
    _finish_rows(panel, names)
    panel.set_xlabel("Factor on Young's modulus")
    add_head(figure, title, _theta_handles(cases, true))
    return figure


@styled
def mode_frequencies(
    posterior: ArrayLike,
    *,
    prior: ArrayLike | None = None,
    measured: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    title: str = "Natural frequencies",
) -> Figure:
    """Draw the frequencies of the first k modes with their 5 to 95 % intervals, mode 1 on top.

    Args:
        posterior: (S, k) Hz.
        prior: (S', k) Hz, or None.
        measured: (k,) Hz with NaN where a mode was not identified, or None.
        names: k names; default "Mode 1", "Mode 2", ...
        title: over the figure.

    Raises:
        ReportError: an array has another shape or too few samples.
    """
    samples = checked("posterior frequencies", posterior, None, None)
    count = samples.shape[1]
    before = None if prior is None else checked("prior frequencies", prior, None, count)
    seen = None if measured is None else checked("measured frequencies", measured, count)
    if min(len(samples), 2 if before is None else len(before)) < 2:
        raise ReportError("the frequencies of two samples or more are needed to draw intervals")
    labels = list(names) if names is not None else [f"Mode {i + 1}" for i in range(count)]
    if len(labels) != count:
        raise ReportError(f"{len(labels)} names are given for {count} modes")
    figure = new_figure(8.5, 0.75 + 0.42 * count)
    panel = figure.subplots()
    for row in range(count):
        panel.barh(row, samples[:, row].mean(), height=0.5, color=SKY, alpha=0.45)
        if before is not None:
            low, high = np.quantile(before[:, row], [0.05, 0.95])
            panel.plot([low, high], [row - 0.33] * 2, color=QUIET, linewidth=3.0)
        _draw_interval(panel, samples[:, row], row, BLUE, _template(samples, " Hz"))
    if seen is not None:
        panel.plot(seen, np.arange(count), **MEASURED)
    _finish_rows(panel, labels)
    panel.invert_yaxis()
    panel.set_xlim(left=0.0)
    panel.set_xlabel("Frequency (Hz)")
    add_head(figure, title, _frequency_handles(before is not None, seen is not None))
    return figure


def _template(samples: Floats, unit: str = "") -> str:
    """Format of mean and 5 to 95 %: two figures of the narrowest interval of samples (S, p)."""
    low, high = np.quantile(samples, [0.05, 0.95], axis=0)
    width = np.maximum(high - low, 1e-3 * np.abs(samples.mean(axis=0)))
    decimals = int(np.clip(1 - np.floor(np.log10(max(width.min(), 1e-4))), 0, 4))
    number = f"{{:.{decimals}f}}"
    return f"{number}{unit}   [{number}, {number}]"


def _draw_interval(panel: Axes, values: Floats, height: float, color: str, text: str) -> None:
    """A line from 5 to 95 %, the mean as a dot, and both in figures at the right."""
    low, high = np.quantile(values, [0.05, 0.95])
    mean = values.mean()
    panel.plot([low, high], [height] * 2, color=color, linewidth=3.2)
    panel.plot(mean, height, "o", color="white", markeredgecolor=color, markersize=5.5, mew=1.4)
    panel.annotate(
        text.format(mean, low, high),
        (1.02, height),
        xycoords=("axes fraction", "data"),
        va="center",
        fontsize=8.5,
        color=color,
    )


def _finish_rows(panel: Axes, names: Sequence[str]) -> None:
    panel.set(yticks=range(len(names)), yticklabels=names, ylim=(-0.6, len(names) - 0.4))
    panel.tick_params(axis="y", length=0, labelsize=10.0)
    panel.grid(visible=False, axis="y")
    panel.spines["left"].set_visible(False)


def _theta_handles(cases: list[Case], truth: Floats | None) -> list[Line2D]:
    handles = [Line2D([], [], linewidth=9.0, label="Prior", **PRIOR)]
    for case in cases:
        label = f"{case.label}: mean, 5 to 95 %" if case.label else "Posterior: mean, 5 to 95 %"
        handles.append(_interval_handle(case.color, label))
    if truth is not None:
        handles.append(Line2D([], [], color=INK, linestyle="--", label="Truth"))
    return handles


def _frequency_handles(prior: bool, measured: bool) -> list[Line2D]:
    handles = [_interval_handle(BLUE, "Posterior: mean, 5 to 95 %")]
    if prior:
        handles.append(Line2D([], [], color=QUIET, linewidth=3.0, label="Prior, 5 to 95 %"))
    if measured:
        handles.append(Line2D([], [], label="Measured", **MEASURED))
    return handles


def _interval_handle(color: str, label: str) -> Line2D:
    marker: dict[str, Any] = {"marker": "o", "markerfacecolor": "white", "markersize": 5.5}
    return Line2D([], [], color=color, linewidth=3.2, label=label, **marker)
