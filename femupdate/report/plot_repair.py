"""The gap between model and measurement, before and after an effect was added."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.discrepancy.repair import Held
from femupdate.effects.effect import DrawnBuilding, Placed
from femupdate.report.curves import Curve, Interval
from femupdate.report.figure import BLUE, DASHES, MEASURED, ORANGE, add_head, new_figure, styled
from femupdate.report.geometry import Geometry, drawn
from femupdate.report.plot_diagnosis import ResidualMap, draw_misfit, largest_misfit
from femupdate.report.plot_posterior import draw_intervals, short_note
from femupdate.report.scenes import draw_marked
from femupdate.units import capital

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
