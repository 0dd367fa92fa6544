"""The stiffness factors in rows: prior range and posterior interval."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report.curves import Interval
from femupdate.report.figure import add_head, new_figure
from femupdate.report.plot_posterior import SampleSet, looks_of
from femupdate.report.style import FAINT, hue, styled

ROW_HEIGHT = 0.26  # inches for each interval
BETWEEN_ROWS = 0.2
_VISIBLE = 0.006  # of the axis: an interval as long as two strokes are wide


@styled
def theta_intervals(
    names: Sequence[str],
    sets: Sequence[SampleSet],
    bounds: Floats,
    *,
    title: str = "Stiffness factors, from prior to posterior",
) -> Figure:
    """Draw each parameter's prior range and its 5 to 95 % interval in every set of samples.

    Args:
        names: p names; the first is drawn lowest, as the first story is.
        sets: one to six posteriors.
        bounds: (p, 2) prior bounds.

    Raises:
        ReportError: there are no samples or too many sets.
    """
    cases = looks_of(sets)
    rows = np.arange(len(names), dtype=np.float64)
    band = ROW_HEIGHT * len(cases) + BETWEEN_ROWS
    figure = new_figure(8.5, 0.75 + band * len(names))
    panel = figure.subplots()
    panel.use_sticky_edges = False
    thick = 0.8 * (band - 0.14) / band
    panel.barh(
        rows, np.ptp(bounds, axis=1), thick, bounds[:, 0], color=FAINT, label="Prior", zorder=1.0
    )
    shown = [Interval.of(one.samples, one.label or "Posterior", k) for k, one in enumerate(cases)]
    for place, one in enumerate(shown):
        heights = rows + ((len(cases) - 1) / 2 - place) * ROW_HEIGHT / band
        draw_intervals(panel, one, heights, label=one.name)
        _write_figures(panel, one, heights)
    panel.set(yticks=rows, yticklabels=names, ylim=(-0.6, len(names) - 0.4))
    panel.tick_params(axis="y", length=0, labelsize=10.0)
    panel.grid(visible=False, axis="y")
    panel.spines["left"].set_visible(False)
    panel.set_xlabel("Stiffness over that in the building file")
    short = short_note(panel, shown)
    order = "Lines of a row are in the order of the legend" if len(cases) > 1 else ""
    read = f"{short}: read the figures at the right" if short else ""
    add_head(figure, title, note="\n".join(one for one in (order, read) if one))
    return figure


def short_note(panel: Axes, shown: Sequence[Interval]) -> str:
    """What to say where an interval is shorter than the stroke at its mean."""
    low, high = panel.get_xlim()
    if min((one.high - one.low).min() for one in shown) > _VISIBLE * (high - low):
        return ""
    return "Some intervals are shorter than the stroke at their mean"


def draw_intervals(panel: Axes, one: Interval, heights: Floats, label: str = "") -> None:
    """Lines from end to end at some heights (r,), and the means as strokes."""
    color = hue(one.series)
    panel.hlines(heights, one.low, one.high, color=color, linewidth=3.2, label=label, zorder=2.0)
    # A stroke covers less of a short interval than a dot does.
    panel.plot(one.mean, heights, "|", color=color, markersize=10.0, mew=1.4)


def _write_figures(panel: Axes, one: Interval, heights: Floats) -> None:
    """Means and ends, with two figures of the narrowest interval."""
    narrowest = np.maximum(one.high - one.low, 1e-3 * np.abs(one.mean)).min()
    digits = int(np.clip(1 - np.floor(np.log10(max(narrowest, 1e-4))), 0, 4))
    for height, *values in zip(heights, one.mean, one.low, one.high, strict=True):
        middle, start, end = (f"{value:.{digits}f}" for value in values)
        panel.annotate(
            f"{middle}   [{start}, {end}]",
            (1.02, height),
            xycoords=("axes fraction", "data"),
            va="center",
            fontsize=8.5,
            color=hue(one.series),
        )
