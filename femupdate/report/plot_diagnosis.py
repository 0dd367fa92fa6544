"""Where a model fails and what could be missing, and both before and after a repair."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.discrepancy.repair import Held
from femupdate.effects.effect import DrawnBuilding, Placed
from femupdate.inference.model_error import Cell
from femupdate.report.curves import Curve, Interval
from femupdate.report.figure import (
    BLUE,
    DASHES,
    FAINT,
    INK,
    MEASURED,
    ORANGE,
    QUIET,
    add_head,
    frequency_ticks,
    new_figure,
    styled,
)
from femupdate.report.geometry import Geometry, drawn
from femupdate.report.plot_posterior import draw_intervals, short_note
from femupdate.report.scenes import draw_marked
from femupdate.result import Picture
from femupdate.units import capital

DISAGREE = "Where model and measurement disagree"


@dataclass(frozen=True)
class ResidualMap:
    """How far every part of some data is missed.

    Attributes:
        rows: f names of floors, bottom to top; of modes, what was compared.
        edges: (b + 1,) Hz of frequency bands; of modes, evenly spaced.
        grid: (f, b) root mean square residual over the noise; NaN where too few points are.
        names: b names of modes; none of bands.
    """

    rows: tuple[str, ...]
    edges: Floats
    grid: Floats
    names: tuple[str, ...] = ()

    @classmethod
    def of(cls, cells: Sequence[Cell], kind: str) -> "ResidualMap":
        """The map of one kind of data."""
        of_kind = [cell for cell in cells if cell.data == kind]
        rows = tuple(dict.fromkeys(cell.floor for cell in of_kind))
        bands = tuple(dict.fromkeys(cell.band_hz for cell in of_kind))
        grid = np.full((len(rows), len(bands)), np.nan)
        for cell in of_kind:
            if cell.excess != 0.0 or cell.p_value != 1.0:
                value = np.sqrt(max(cell.excess + 1.0, 0.0))
                grid[rows.index(cell.floor), bands.index(cell.band_hz)] = value
        if all(low == high for low, high in bands):
            names = tuple(f"{low:.3g} Hz" for low, _ in bands)
            return cls(rows, np.arange(len(bands) + 1.0), grid, names)
        return cls(rows, np.array([bands[0][0], *(band[1] for band in bands)]), grid)

    @property
    def middle(self) -> Floats:
        """(b,) where a column's text stands."""
        if self.names:
            return 0.5 * (self.edges[:-1] + self.edges[1:])
        return np.asarray(np.sqrt(self.edges[:-1] * self.edges[1:]))

    def mark(self, panel: Axes) -> None:
        """Name rows and columns."""
        panel.set_yticks(range(len(self.rows)), self.rows)
        if self.names:
            panel.set_xticks(self.middle, self.names)
        else:
            frequency_ticks(panel, self.edges[0], self.edges[-1])
        panel.set_xlabel("Identified mode" if self.names else "Frequency, Hz")


Ranked = tuple[str, float, str, bool]
"""An effect in words, its log evidence over the model without it, its size, whether it leads."""


def residual_pictures(
    name: str, models: Mapping[str, Sequence[Cell]], title: str = DISAGREE
) -> Iterator[Picture]:
    """The residuals of one model or several, one picture a kind of data."""
    for kind in dict.fromkeys(cell.data for cell in next(iter(models.values()))):
        of_kind = f", {kind}" if kind else ""
        maps = [(f"{of}{of_kind}", ResidualMap.of(cells, kind)) for of, cells in models.items()]
        draw = partial(residual_map, maps, title=title)
        yield Picture("_".join([name, *kind.split()]), draw)


@styled
def residual_map(maps: Sequence[tuple[str, ResidualMap]], *, title: str = DISAGREE) -> Figure:
    """Draw the misfit of every floor in every band, one panel a model.

    Args:
        maps: name of a model and its residuals, all of the same data.
    """
    figure = new_figure(4.6 * len(maps) + 1.2, 0.9 + 0.38 * len(maps[0][1].rows))
    panels = np.atleast_1d(figure.subplots(1, len(maps), sharey=True))
    top = largest_misfit([shown for _, shown in maps])
    pictures = []
    for panel, (name, shown) in zip(panels, maps, strict=True):
        pictures.append(draw_misfit(panel, shown, top))
        panel.set_title(name)
    bar = figure.colorbar(pictures[0], ax=list(panels), pad=0.02)
    bar.set_label("Residual over noise, rms")
    add_head(
        figure,
        title,
        note="1 and less is what noise alone leaves; grey, without a figure: too few points",
    )
    return figure


def largest_misfit(maps: Sequence[ResidualMap]) -> float:
    """Where the colours of some misfits end."""
    grids = [shown.grid for shown in maps if np.isfinite(shown.grid).any()]
    largest = max((float(np.nanmax(grid)) for grid in grids), default=2)
    # Beyond 30 times the noise a colour says no more.
    return float(np.clip(largest, 2.0, 30.0))


def draw_misfit(panel: Axes, shown: ResidualMap, top: float) -> QuadMesh:
    """Draw one misfit; the colours end at `top`."""
    edges, norm = np.arange(len(shown.grid) + 1) - 0.5, Normalize(1.0, top)
    picture = panel.pcolormesh(shown.edges, edges, shown.grid, cmap="OrRd", norm=norm)
    panel.grid(False)
    panel.set_facecolor(FAINT)
    for row, values in enumerate(shown.grid):
        for x, value in zip(shown.middle, values, strict=True):
            if np.isfinite(value):
                strong = value > 0.55 * (1.0 + top)
                text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
                colour = "white" if strong else INK
                panel.text(x, row, text, ha="center", va="center", fontsize=7, color=colour)
    shown.mark(panel)
    return picture


@styled
def ranking(effects: Sequence[Ranked], needed: float, verdict: str) -> Figure:
    """Draw the log evidence of the leading effects over the model without them.

    Args:
        effects: the strongest first.
        needed: log evidence that a name needs.
        verdict: in a sentence or two, under the title.
    """
    shown = list(effects)[::-1]
    figure = new_figure(8.0, 0.8 + 0.3 * len(shown))
    panel = figure.subplots()
    for row, (_, gain, size, leading) in enumerate(shown):
        length = _scaled(gain)
        panel.barh(row, length, color=ORANGE if leading else BLUE, height=0.62)
        panel.annotate(
            f"{round(gain):,}   {size}".rstrip(),
            (max(length, 0.0), row),
            xytext=(3.0, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=INK,
            # On white, so that the dashed line does not cross it.
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )
    panel.axvline(_scaled(needed), color=QUIET, linestyle="--", linewidth=1.0)
    panel.axvline(0.0, color=INK, linewidth=0.8)
    panel.set_yticks(range(len(shown)), [label for label, *_ in shown])
    decades = [-10.0, 0.0, needed, 10.0, 100.0, 1e3, 1e4, 1e5]
    gains = [gain for _, gain, *_ in shown]
    low, high = min(0.0, *gains), max(gains)
    ticks = [t for t in decades if low <= t <= 3.0 * high or t in (0.0, needed)]
    left, right = _scaled(max(low, -30.0)) - 0.1, 1.45 * _scaled(max(high, 3.0 * needed))
    # Ticks nearer than this share of the axis run into one another.
    least, kept = 0.055 * (right - left), list[float]()
    for tick in (needed, 0.0, *ticks):
        if all(abs(_scaled(tick) - _scaled(other)) >= least for other in kept):
            kept.append(tick)
    kept.sort()
    panel.set_xticks(
        [_scaled(t) for t in kept], [f"{t:.3g}" if t < 1e3 else f"{t:,.0f}" for t in kept]
    )
    panel.set_xlim(left, right)
    panel.set_xlabel("Log evidence over the model as it is\n(dashed: what a name needs)")
    panel.grid(axis="y", visible=False)
    add_head(figure, "What could be missing", note=verdict)
    return figure


def _scaled(gain: float) -> float:
    """A scale that is linear near zero and logarithmic beyond."""
    return float(np.arcsinh(gain / 2.0))


_BEFORE: dict[str, Any] = {
    "color": ORANGE,
    "linestyle": DASHES[1],
    "linewidth": 1.1,
    "label": "Model before",
}
_AFTER: dict[str, Any] = {"color": BLUE, "linewidth": 1.1, "label": "Model after"}
_MEASURED: dict[str, Any] = {**MEASURED, "label": "Measured"}


@styled
def gap_story(
    maps: Sequence[ResidualMap],
    building: DrawnBuilding,
    added: Sequence[Placed],
    curves: Sequence[Curve],
    names: Sequence[str],
    draws: Sequence[Floats],
    held: Held | None = None,
) -> Figure:
    """Draw residuals before and after, what was added between them, FRFs, factors, held-out data.

    Of everything that has a before and an after, the latter is missing where nothing was added.

    Args:
        maps: residuals of the first data before and after.
        building: to mark on it what was added.
        curves: ln|H| of every floor, with the model after in `beside`; none without FRFs.
        names: p names of the stiffness factors.
        draws: (n, p) of them before and after.
        held: data kept out, if any.
    """
    kept, mended = _kept_out(held), len(maps) > 1
    # The three floors that the model before missed most, from the top down.
    seen = [curve.seen(used=True) for curve in curves]
    misfit = [
        0.0 if values is None else -float(np.nanmean((values - curve.mean) ** 2))
        for values, curve in zip(seen, curves, strict=True)
    ]
    chosen = [curves[k] for k in sorted(np.argsort(misfit, kind="stable")[:3])]
    rows = max(len(chosen), 1)
    above = [max(3.4, 0.42 * len(maps[0].rows))] if mended else []
    height = [*above, *[1.6 if chosen else 2.4] * rows, *([] if kept is None else [1.9])]
    figure = new_figure(12.0, sum(height) + 1.0)
    grid = figure.add_gridspec(len(height), 3, height_ratios=height)
    first = len(above)
    if mended:
        panels = [figure.add_subplot(grid[0, column]) for column in range(3)]
        top = largest_misfit(maps)
        for panel, name, residuals in zip(panels[::2], ("Before", "After"), maps, strict=True):
            picture = draw_misfit(panel, residuals, top)
            panel.set_title(f"{name}: residual over noise")
        figure.colorbar(picture, ax=panels[-1], pad=0.02)
        structure = building.structure
        glyphs = drawn(sign for each in added for sign in each.effect.glyphs(building, each.place))
        floors = list(zip(structure.floors, structure.levels.tolist(), strict=True))
        draw_marked(panels[1], Geometry.of_building(building), glyphs, floors)
        panels[1].set_title("\n".join(each.in_words for each in added), loc="center")
    for row, curve in enumerate(chosen, first):
        panel = figure.add_subplot(grid[row, :2])
        _draw_models(panel, curve)
        if curve is not chosen[-1]:
            panel.set_xlabel("")
            panel.tick_params(labelbottom=False)
    beside = slice(2, 3) if chosen else slice(0, 3)
    panel = figure.add_subplot(grid[first : first + rows, beside])
    # The colours of the model before and after.
    shown = [Interval.of(values, series=k) for values, k in zip(draws, (1, 0), strict=False)]
    for interval, shift in zip(shown, (0.12, -0.12), strict=False):
        draw_intervals(panel, interval, np.arange(len(names), dtype=np.float64) + shift)
    panel.set_yticks(range(len(names)), list(names))
    panel.set_xlabel("Stiffness factor, mean, 5 to 95 %")
    order = "Of two factors the upper is before" if len(draws) > 1 else ""
    short = short_note(panel, shown)
    if kept is not None:
        panel = figure.add_subplot(grid[first + rows, :])
        _draw_models(panel, kept)
        panel.set_title(kept.title)
    grey = "Grey cells without a figure: too few points" if mended else ""
    note = ". ".join(text for text in (grey, order, short) if text)
    add_head(figure, repair_headline(added), note=note)
    return figure


def repair_headline(added: Sequence[Placed]) -> str:
    """What a repair added."""
    words = (words_of.in_words for words_of in added)
    told = "; ".join(words_of[0].lower() + words_of[1:] for words_of in words)
    return f"Added: {told}" if told else "Nothing was added"


def _draw_models(panel: Axes, curve: Curve) -> None:
    """What was measured, and the model before and after."""
    if (seen := curve.seen(used=True)) is not None:
        panel.plot(curve.x, seen, **_MEASURED)
    panel.plot(curve.x, curve.mean, **_BEFORE)
    if curve.beside is not None:
        panel.plot(curve.x, curve.beside, **_AFTER)
    panel.set(xlabel=capital(curve.across), ylabel=curve.up)
    panel.set_xlim(float(curve.x[0]), float(curve.x[-1]))


def _kept_out(held: Held | None) -> Curve | None:
    """The roof's history around its largest acceleration, where there are histories."""
    if held is None or held.histories is None:
        return None
    time, measured, before, after = held.histories
    errors = held.figures["error"]
    changed, text = errors[1] != errors[0], f"{held.name}, kept out: error {errors[0]:.2f}"
    curve = Curve(
        title=f"{text} before, {errors[1]:.2f} after" if changed else text,
        across="time, s",
        up=f"{held.roof}, m/s²",
        x=time,
        mean=before,
        measured=measured,
        beside=after if changed else None,
    )
    return curve.at(np.abs(time - time[np.abs(measured).argmax()]) <= 3.0)
