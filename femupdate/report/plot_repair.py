"""The gap between model and measurement, before and after an effect was added."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report.figure import add_head, new_figure
from femupdate.report.geometry import Geometry
from femupdate.report.glyphs import Glyphs
from femupdate.report.marked_building import draw_marked
from femupdate.report.plot_diagnosis import Columns, draw_misfit, largest_misfit
from femupdate.report.plot_intervals import short_note
from femupdate.report.rendering import Renderer
from femupdate.report.style import BLUE, DASHES, MEASURED, ORANGE, styled

_BEFORE: dict[str, Any] = {
    "color": ORANGE,
    "linestyle": DASHES[1],
    "linewidth": 1.1,
    "label": "Model before",
}
_AFTER: dict[str, Any] = {"color": BLUE, "linewidth": 1.1, "label": "Model after"}
_MEASURED: dict[str, Any] = {**MEASURED, "label": "Measured"}
_WINDOW_S = 6.0


@dataclass(frozen=True)
class Curves:
    """FRFs of the measured floors.

    Attributes:
        frequency_hz: (k,).
        floors: f names.
        measured: (f, k) ln|H|, NaN where not valid.
        before, after: (f, k) of the models; after is None where nothing was added.
    """

    frequency_hz: Floats
    floors: Sequence[str]
    measured: Floats
    before: Floats
    after: Floats | None


@dataclass(frozen=True)
class Scene:
    """Where the model failed, what was added and where it sits, what is left.

    Attributes:
        rows: what was measured, such as floors.
        columns: the bands or modes of the maps.
        before, after: (f, b) rms residual over noise.
        geometry: of the building.
        glyphs: the signs of what was added.
        floors: names and heights (m) of the building's floors.
        caption: what was added.
    """

    rows: Sequence[str]
    columns: Columns
    before: Floats
    after: Floats
    geometry: Geometry
    glyphs: Glyphs
    floors: Sequence[tuple[str, float]]
    caption: str


@dataclass(frozen=True)
class GapStory:
    """All that one picture tells.

    Attributes:
        headline: what was added.
        scene: residuals and the building between them; None where nothing was added.
        curves: FRFs; None where none were measured.
        names: p names of the stiffness factors.
        theta_before, theta_after: (n, p) draws.
        held: histories of data kept out (attributes name, floors, time, measured, before, after,
            error_before, error_after), or None.
    """

    headline: str
    scene: Scene | None
    curves: Curves | None
    names: Sequence[str]
    theta_before: Floats
    theta_after: Floats | None
    held: Any


@styled
def gap_story(story: GapStory, renderer: Renderer = "auto") -> Figure:
    """Draw residuals before and after, what was added between them, FRFs, factors, held-out data.

    Args:
        renderer: of the building, as for `mode_shape_figure`.
    """
    curves = story.curves
    chosen = [] if curves is None else _floors(curves)
    rows = max(len(chosen), 1)
    above = [] if story.scene is None else [max(3.4, 0.42 * len(story.scene.rows))]
    height = [*above, *[1.6 if chosen else 2.4] * rows, *([] if story.held is None else [1.9])]
    figure = new_figure(12.0, sum(height) + 1.0)
    grid = figure.add_gridspec(len(height), 3, height_ratios=height)
    first = len(above)
    if story.scene is not None:
        panels = [figure.add_subplot(grid[0, column]) for column in range(3)]
        _scene(figure, panels, story.scene, renderer)
    if curves is not None:
        for row, place in enumerate(chosen):
            panel = figure.add_subplot(grid[first + row, :2])
            _frf(panel, curves, place, last=row == rows - 1)
    beside = slice(2, 3) if chosen else slice(0, 3)
    short = _theta(figure.add_subplot(grid[first : first + rows, beside]), story)
    if story.held is not None:
        _histories(figure.add_subplot(grid[first + rows, :]), story.held)
    grey = "" if story.scene is None else "Grey cells without a figure: too few points"
    add_head(figure, story.headline, note=". ".join(one for one in (grey, short) if one))
    return figure


def _scene(figure: Figure, panels: Sequence[Axes], scene: Scene, renderer: Renderer) -> None:
    grids = [scene.before, scene.after]
    top = largest_misfit(grids)
    for panel, name, grid in zip(panels[::2], ("Before", "After"), grids, strict=True):
        picture = draw_misfit(panel, scene.rows, scene.columns, grid, top)
        panel.set_title(f"{name}: residual over noise")
    figure.colorbar(picture, ax=panels[2], pad=0.02)
    draw_marked(panels[1], scene.geometry, scene.glyphs, scene.floors, renderer)
    panels[1].set_title(scene.caption, loc="center")


def _floors(curves: Curves) -> list[int]:
    """The three floors that the model before missed most, from the top down."""
    misfit = np.nanmean((curves.measured - curves.before) ** 2, axis=1)
    worst = np.argsort(-np.nan_to_num(misfit))[:3]
    return sorted((int(k) for k in worst), reverse=True)


def _frf(panel: Axes, curves: Curves, place: int, *, last: bool) -> None:
    frequency = curves.frequency_hz
    panel.plot(frequency, curves.measured[place], **_MEASURED)
    panel.plot(frequency, curves.before[place], **_BEFORE)
    if curves.after is not None:
        panel.plot(frequency, curves.after[place], **_AFTER)
    panel.set_ylabel(f"{curves.floors[place]}, ln|H|")
    panel.set_xlim(float(frequency[0]), float(frequency[-1]))
    if last:
        panel.set_xlabel("Frequency, Hz")
    else:
        panel.tick_params(labelbottom=False)


def _theta(panel: Axes, story: GapStory) -> str:
    """Draw the factors; returns what is to be said of their intervals."""
    sets = [(story.theta_before, _BEFORE, 0.12)]
    if story.theta_after is not None:
        sets.append((story.theta_after, _AFTER, -0.12))
    for draws, style, shift in sets:
        low, high = np.quantile(draws, [0.05, 0.95], axis=0)
        middle = draws.mean(axis=0)
        rows = np.arange(len(story.names)) + shift
        panel.hlines(rows, low, high, color=style["color"], linewidth=3.0)
        # A stroke covers less of a short interval than a dot does.
        panel.plot(middle, rows, "|", color=style["color"], markersize=11.0, mew=1.4)
    panel.set_yticks(range(len(story.names)), list(story.names))
    panel.set_xlabel("Stiffness factor, mean, 5 to 95 %")
    order = "" if story.theta_after is None else "Of two factors the upper is before"
    said = (order, short_note(panel, [draws for draws, _, _ in sets]))
    return ". ".join(one for one in said if one)


def _histories(panel: Axes, held: Any) -> None:
    """The roof around its largest acceleration."""
    top = len(held.floors) - 1
    peak = held.time[np.abs(held.measured[top]).argmax()]
    shown = np.abs(held.time - peak) <= 0.5 * _WINDOW_S
    panel.plot(held.time[shown], held.measured[top][shown], **_MEASURED)
    panel.plot(held.time[shown], held.before[top][shown], **_BEFORE)
    text = f"{held.name}, kept out: error {held.error_before:.2f}"
    if held.error_after != held.error_before:
        panel.plot(held.time[shown], held.after[top][shown], **_AFTER)
        text += f" before, {held.error_after:.2f} after"
    panel.set_title(text)
    panel.set_xlabel("Time, s")
    panel.set_ylabel(f"{held.floors[top]}, m/s²")
    panel.set_xlim(float(held.time[shown][0]), float(held.time[shown][-1]))
