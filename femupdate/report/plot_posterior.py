"""Posterior samples of the parameters: in pairs with their densities, and as intervals."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, ScalarFormatter

from femupdate.arrays import Floats
from femupdate.report.curves import Interval
from femupdate.report.figure import DASHES, FAINT, KNOWN, add_head, hue, look, new_figure, styled
from femupdate.report.scale import plus_minus

POINTS = 250  # drawn under the contours; more hide each other
MOST = 12  # parameters in one figure; more cannot be read
_NAME = 18  # characters of a name that stand below a panel


@styled
def posterior_pairs(
    sets: Mapping[str, Floats],
    names: Sequence[str],
    bounds: Floats,
    truth: Sequence[float] | Floats | None = None,
) -> Figure:
    """Draw each parameter on the diagonal, pairs below it, correlations above.

    Of more than `MOST` parameters those are drawn that are correlated most with another one.

    Args:
        sets: draws (S, p) of one to six posteriors of the same parameters, by what they are of.
        bounds: (p, 2) prior bounds.
        truth: (p,) true values, where they are known.
    """
    cases, total = sets, len(names)
    true = None if truth is None else np.asarray(truth, dtype=np.float64)
    if total > MOST:
        shown = most_correlated(next(iter(cases.values())), MOST)
        names, bounds = [names[k] for k in shown], bounds[shown]
        cases = {label: samples[:, shown] for label, samples in cases.items()}
        true = None if true is None else true[shown]
    # What each axis shows: all but the last strays of the samples, within the prior.
    views = []
    for index, (low, high) in enumerate(bounds):
        tails = [np.quantile(samples[:, index], [0.001, 0.999]) for samples in cases.values()]
        seen = np.concatenate([*tails, [] if true is None else true[index : index + 1]])
        room = 0.12 * (np.ptp(seen) or 0.1 * (high - low))
        views.append((max(seen.min() - room, low), min(seen.max() + room, high)))
    size = len(names)
    side = max(1.25, min(2.1, 9.5 / size))
    figure = new_figure(max(side * size + 0.5, 5.4), side * size + 0.4)
    axes = figure.subplots(size, size, squeeze=False, gridspec_kw={"wspace": 0.0, "hspace": 0.0})
    for (row, column), panel in np.ndenumerate(axes):
        panel.grid(False)
        if row == column:
            _draw_marginal(panel, cases, row, views[row], true)
        elif row > column:
            _draw_pair(panel, cases, (column, row), views, true)
        else:
            _draw_correlation(panel, cases, column, row)
        _label(panel, row, column, names)
    note = "Contours hold 50 and 90 %; on the diagonal mean ± sd; above it correlations"
    if size < total:
        note = f"The {size} of {total} with the strongest correlations. {note}"
    add_head(figure, "Posterior of the parameters", note=note if size > 1 else "")
    return figure


def _draw_marginal(
    panel: Axes,
    cases: Mapping[str, Floats],
    index: int,
    view: tuple[float, float],
    truth: Floats | None,
) -> None:
    top = 0.0
    for line, (label, samples) in enumerate(cases.items()):
        values = samples[:, index]
        x, density = density_1d(values, view)
        panel.fill_between(x, density, color=hue(line), alpha=0.18, linewidth=0.0)
        panel.plot(x, density, label=label, **look(line))
        top = max(top, density.max())
        panel.annotate(
            plus_minus(values.mean(), values.std(ddof=1)),
            (0.5, 1.0),
            xycoords="axes fraction",
            xytext=(0, -4 - 11 * line),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=8.5,
            color=hue(line),
            fontweight="bold",
        )
    panel.set(xlim=view, ylim=(0.0, top * (1.12 + 0.22 * len(cases))))
    if truth is not None:
        panel.axvline(truth[index], ymax=0.7, label="Truth", **KNOWN)


def _draw_pair(
    panel: Axes,
    cases: Mapping[str, Floats],
    pair: tuple[int, int],
    views: list[tuple[float, float]],
    truth: Floats | None,
) -> None:
    across, up = (views[index] for index in pair)
    for line, samples in enumerate(cases.values()):
        x, y = (samples[:, index] for index in pair)
        thin = slice(None, None, max(1, len(x) // POINTS))
        panel.plot(x[thin], y[thin], ".", color=hue(line), markersize=1.6, alpha=0.35, mew=0)
        density = density_2d(x, y, across, up)
        levels = sorted({mass_level(density[-1], share) for share in (0.9, 0.5)})
        fill = [to_rgba(hue(line), alpha) for alpha in (0.16, 0.3)]
        panel.contourf(*density, [*levels, np.inf], colors=fill[-len(levels) :])
        lines: dict[str, Any] = {"colors": hue(line), "linestyles": [DASHES[line]]}
        panel.contour(*density, levels, linewidths=0.9, **lines)
    if truth is not None:
        panel.axvline(truth[pair[0]], **KNOWN)
        panel.axhline(truth[pair[1]], **KNOWN)
    panel.set(xlim=across, ylim=up)


def _draw_correlation(panel: Axes, cases: Mapping[str, Floats], first: int, second: int) -> None:
    panel.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    panel.set_axis_off()
    for line, samples in enumerate(cases.values()):
        value = correlation(samples[:, first], samples[:, second])
        weak = abs(value) < 0.2
        panel.text(
            0.5,
            0.5 + 0.22 * ((len(cases) - 1) / 2 - line),
            f"{value:+.2f}".replace("-", "\u2212"),
            ha="center",
            va="center",
            fontsize=9.0 + 5.0 * abs(value),
            color=hue(line),
            alpha=0.75 if weak else 1.0,
        )


def most_correlated(samples: Floats, count: int) -> list[int]:
    """So many columns of samples (S, p), in their order: those with the strongest correlations."""
    varied = np.where(samples.std(axis=0) > 0.0, samples.std(axis=0), np.inf)
    standard = (samples - samples.mean(axis=0)) / varied
    size = np.abs(standard.T @ standard) / len(samples)
    np.fill_diagonal(size, 0.0)
    return sorted(np.argsort(-size.max(axis=0), kind="stable")[:count].tolist())


def correlation(x: Floats, y: Floats) -> float:
    """Correlation of two rows of samples, 0 where one of them does not vary."""
    spread = x.std() * y.std()
    return float(((x - x.mean()) * (y - y.mean())).mean() / spread) if spread > 0.0 else 0.0


def _label(panel: Axes, row: int, column: int, names: Sequence[str]) -> None:
    last = len(names) - 1
    for axis in (panel.xaxis, panel.yaxis):
        # Round values away from the ends, whose labels would push the panels apart.
        low, high = axis.get_view_interval()
        room = 0.14 * (high - low)
        # In narrow panels, and where they have many digits, more figures would meet.
        most = 3 if last < 6 and high - low > 0.01 * max(abs(low), abs(high)) else 2
        ticks = MaxNLocator(most).tick_values(low + room, high - room)
        inner = [float(tick) for tick in ticks if low + room <= tick <= high - room]
        axis.set_major_locator(FixedLocator(inner))
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
    panel.tick_params(
        labelsize=8.0,
        bottom=row == last,
        labelbottom=row == last,
        left=column == 0 and row > 0,
        labelleft=column == 0 and row > 0,
    )
    panel.spines[["top", "right"]].set_visible(True)
    if row == last:
        panel.set_xlabel(textwrap.fill(names[column], _NAME))
    if column == 0 and row > 0:
        panel.set_ylabel(textwrap.fill(names[row], _NAME))


CELLS = 80


def bandwidth(samples: Floats, dimensions: int) -> float:
    """Width of the smoothing kernel by Scott's rule (1992), from the spread of the narrowest mode.

    Separate modes have a standard deviation that says how far apart they lie, not how wide they
    are: the shortest interval with a quarter of the samples (0.637 sd of a normal) does.
    """
    ordered = np.sort(samples)
    quarter = max(1, len(ordered) // 4)
    # The shortest interval with a quarter of a normal's mass, in standard deviations.
    shortest = float((ordered[quarter:] - ordered[:-quarter]).min()) / (2.0 * 0.31864)
    spread = min(ordered.std(), shortest) or ordered.std()
    return float(spread * len(samples) ** (-1.0 / (dimensions + 4)))


def density_1d(samples: Floats, limits: tuple[float, float]) -> tuple[Floats, Floats]:
    """Centres of cells and density of samples (S,), mirrored at the limits so as not to sink."""
    from scipy.ndimage import gaussian_filter1d

    cells = 4 * CELLS
    counts, edges = np.histogram(samples, cells, range=limits)
    width = bandwidth(samples, 1) * cells / (limits[1] - limits[0])
    smooth = gaussian_filter1d(counts.astype(float), max(width, 1.0), mode="reflect")
    return _centres(edges), smooth / max(smooth.sum(), 1e-300)


def density_2d(
    x: Floats, y: Floats, across: tuple[float, float], up: tuple[float, float]
) -> tuple[Floats, Floats, Floats]:
    """Centres of cells and density of pairs (S,): (CELLS, CELLS) with y along its first axis."""
    from scipy.ndimage import gaussian_filter

    counts, y_edges, x_edges = np.histogram2d(y, x, CELLS, range=(up, across))
    widths = [
        max(bandwidth(values, 2) * CELLS / (limits[1] - limits[0]), 1.0)
        for values, limits in ((y, up), (x, across))
    ]
    smooth = gaussian_filter(counts, widths, mode="reflect")
    return _centres(x_edges), _centres(y_edges), smooth / max(smooth.sum(), 1e-300)


def mass_level(value: Floats, share: float) -> float:
    """Level above which the smallest region lies that holds this share of the density."""
    ordered = np.sort(value, axis=None)[::-1]
    held = np.cumsum(ordered) / ordered.sum()
    return float(ordered[min(int(np.searchsorted(held, share)), len(ordered) - 1)])


def _centres(edges: Floats) -> Floats:
    return 0.5 * (edges[1:] + edges[:-1])


ROW_HEIGHT = 0.26  # inches for each interval


@styled
def theta_intervals(
    names: Sequence[str],
    sets: Mapping[str, Floats],
    bounds: Floats,
    *,
    title: str = "Stiffness factors, from prior to posterior",
) -> Figure:
    """Draw each parameter's prior range and its 5 to 95 % interval in every set of samples.

    Args:
        names: p names; the first is drawn lowest, as the first story is.
        sets: draws (S, p) of one to six posteriors, by what they are of.
        bounds: (p, 2) prior bounds.
    """
    rows = np.arange(len(names), dtype=np.float64)
    band = ROW_HEIGHT * len(sets) + 0.2
    figure = new_figure(8.5, 0.75 + band * len(names))
    panel = figure.subplots()
    panel.use_sticky_edges = False
    thick = 0.8 * (band - 0.14) / band
    panel.barh(
        rows, np.ptp(bounds, axis=1), thick, bounds[:, 0], color=FAINT, label="Prior", zorder=1.0
    )
    shown = [
        Interval.of(samples, label or "Posterior", k)
        for k, (label, samples) in enumerate(sets.items())
    ]
    for place, interval in enumerate(shown):
        heights = rows + ((len(sets) - 1) / 2 - place) * ROW_HEIGHT / band
        draw_intervals(panel, interval, heights, label=interval.name)
        _write_figures(panel, interval, heights)
    panel.set(yticks=rows, yticklabels=names, ylim=(-0.6, len(names) - 0.4))
    panel.tick_params(axis="y", length=0, labelsize=10.0)
    panel.grid(visible=False, axis="y")
    panel.spines["left"].set_visible(False)
    panel.set_xlabel("Stiffness over that in the building file")
    short = short_note(panel, shown)
    order = "Lines of a row are in the order of the legend" if len(sets) > 1 else ""
    read = f"{short}: read the figures at the right" if short else ""
    add_head(figure, title, note="\n".join(sentence for sentence in (order, read) if sentence))
    return figure


def short_note(panel: Axes, shown: Sequence[Interval]) -> str:
    """What to say where an interval is shorter than the stroke at its mean."""
    low, high = panel.get_xlim()
    # An interval as long as two strokes are wide, as a share of the axis.
    if min((interval.high - interval.low).min() for interval in shown) > 0.006 * (high - low):
        return ""
    return "Some intervals are shorter than the stroke at their mean"


def draw_intervals(panel: Axes, interval: Interval, heights: Floats, label: str = "") -> None:
    """Lines from end to end at some heights (r,), and the means as strokes."""
    color = hue(interval.series)
    panel.hlines(
        heights, interval.low, interval.high, color=color, linewidth=3.2, label=label, zorder=2.0
    )
    # A stroke covers less of a short interval than a dot does.
    panel.plot(interval.mean, heights, "|", color=color, markersize=10.0, mew=1.4)


def _write_figures(panel: Axes, interval: Interval, heights: Floats) -> None:
    """Means and ends, with two figures of the narrowest interval."""
    narrowest = np.maximum(interval.high - interval.low, 1e-3 * np.abs(interval.mean)).min()
    digits = int(np.clip(1 - np.floor(np.log10(max(narrowest, 1e-4))), 0, 4))
    for height, *values in zip(heights, interval.mean, interval.low, interval.high, strict=True):
        middle, start, end = (f"{value:.{digits}f}" for value in values)
        panel.annotate(
            f"{middle}   [{start}, {end}]",
            (1.02, height),
            xycoords=("axes fraction", "data"),
            va="center",
            fontsize=8.5,
            color=hue(interval.series),
        )
