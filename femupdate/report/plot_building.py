"""The building at rest, plans of its stories, and mode shapes of sticks.

At rest it is drawn with grid, floors, sensors and axes. A stick has a point at every floor.
"""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.building.mesh import BuildingMesh
from femupdate.report.figure import (
    BAND,
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    QUIET,
    add_head,
    nearly_all,
    new_figure,
    panel_grid,
    styled,
    thin_band_note,
)
from femupdate.report.geometry import Geometry, Glyphs
from femupdate.report.scenes import draw_marked, project

Lines = Sequence[Mapping[str, float]]
"""Names and places, m, of the grid lines at a constant x and of those at a constant y."""

_BUBBLE = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": QUIET}


@styled
def building_view(
    geometry: Geometry, glyphs: Glyphs, floors: Sequence[tuple[str, float]], grid: Lines = ()
) -> Figure:
    """Draw the building at rest with its sensors, floors (name and height, m), grid and axes."""
    seen = np.ptp(project(geometry.nodes)[0], axis=0)
    figure = new_figure(6.8, float(np.clip(4.6 * seen[1] / seen[0] + 0.6, 2.6, 6.0)))
    panel = figure.subplots()
    # The mark of a grid line stands where the name of the base would.
    draw_marked(panel, geometry, glyphs, floors[1:] if grid else floors)
    low, high = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
    gap = 0.09 * geometry.size
    for axis, lines in enumerate(grid):
        for name, place in lines.items():
            ends = np.array([low, high])
            ends[:, axis], ends[0, 1 - axis], ends[1, 2] = place, low[1 - axis] - gap, low[2]
            flat = project(ends)[0]
            panel.plot(*flat.T, color=QUIET, linewidth=0.7, linestyle=(0.0, (8.0, 2.0, 2.0, 2.0)))
            panel.text(
                flat[0, 0], flat[0, 1], name, ha="center", va="center", fontsize=7.5, bbox=_BUBBLE
            )
    add_head(figure, "The model at rest", note="Orange: sensors and the direction they measure")
    return figure


@styled
def story_plans(mesh: BuildingMesh, names: Sequence[str], grid: Lines = ()) -> Figure:
    """Draw the plan of every story that differs from the others: what it owns, sensors above it."""
    plans = [_members(mesh, story) for story in range(len(names))]
    alike: dict[bytes, list[int]] = {}
    for story, plan in enumerate(plans):
        key = b"|".join(np.unique(part.round(3), axis=0).tobytes() for part in plan.values())
        alike.setdefault(key, []).append(story)
    columns = min(len(alike), 3)
    nodes = mesh.model.nodes
    spread = np.ptp(nodes[:, :2], axis=0)
    width = 8.6 / max(columns, 1.6)
    high = float(np.clip(width * spread[1] / max(spread[0], 1e-9), 1.4, 6.0))
    high += 0.3 if len(alike) <= columns else 0.6  # for the figures under each row
    figure, panels = panel_grid(len(alike), columns, (width, high), "x, m", "y, m")
    for panel, stories in zip(panels, alike.values(), strict=True):
        sensors = [node for k in stories for node in mesh.floor_nodes[mesh.floors[k]]]
        _draw_plan(panel, plans[stories[0]], np.unique(nodes[sensors, :2].round(6), axis=0), grid)
        panel.set_title(_ranges(stories, names), pad=14.0)
    add_head(figure, "Plans", note="What stands in a story, and the beams and sensors above it")
    return figure


def _members(mesh: BuildingMesh, story: int) -> dict[str, Floats]:
    """Columns (n, 2), and beams, walls and braces as segments (n, 2, 2), in plan."""
    model, groups = mesh.model, []
    for size in (1, 2):
        numbers = [block.group for block in model.elements if block.dimension() == size]
        groups.append(np.concatenate([[], *numbers]))
    bars = model.nodes[model.lines[groups[0] == story]]
    rise = np.abs(bars[:, 1, 2] - bars[:, 0, 2])
    run = np.linalg.norm(bars[:, 1, :2] - bars[:, 0, :2], axis=1)
    faces = model.nodes[model.faces[groups[1] == story]]
    upright = faces[np.ptp(faces[..., 2], axis=1) > 1e-6]
    # A wall in plan is the longest distance between two of its corners.
    walls = np.stack([upright[:, [0, 2], :2], upright[:, [1, 3], :2]], axis=1)
    longest = np.linalg.norm(walls[:, :, 1] - walls[:, :, 0], axis=-1).argmax(axis=1)
    return {
        "column": bars[run <= 0.05 * rise][:, 0, :2],
        "beam": bars[rise <= 0.05 * run][:, :, :2],
        "brace or infill": bars[(run > 0.05 * rise) & (rise > 0.05 * run)][:, :, :2],
        "wall": walls[np.arange(len(walls)), longest],
    }


def _draw_plan(panel: Axes, plan: Mapping[str, Floats], sensors: Floats, grid: Lines) -> None:
    for axis, lines in enumerate(grid):
        for name, place in lines.items():
            (panel.axvline if axis == 0 else panel.axhline)(place, color=FAINT, linewidth=0.8)
            at, frame = (place, 1.0), panel.get_xaxis_transform()
            if axis == 1:
                at, frame = (1.0, place), panel.get_yaxis_transform()
            look: dict[str, Any] = {"fontsize": 7, "bbox": _BUBBLE, "ha": "center", "va": "center"}
            panel.annotate(name, at, xycoords=frame, **look).set_in_layout(False)
    looks: dict[str, Any] = {
        "beam": (QUIET, 1.0, "-"),
        "brace or infill": (GREEN, 1.6, "--"),
        "wall": (INK, 3.2, "-"),
    }
    for name, (color, wide, dashes) in looks.items():
        if len(plan[name]):
            look = {"colors": color, "linewidths": wide, "linestyles": dashes}
            drawn = LineCollection(list(plan[name]), label=name, **look)
            panel.add_collection(drawn)
    if len(plan["column"]):
        panel.plot(*plan["column"].T, "s", color=INK, markersize=5.0, label="column")
    panel.plot(*sensors.T, "^", color=ORANGE, markersize=6.5, label="sensor")
    panel.grid(visible=False)
    panel.autoscale_view()
    panel.margins(0.08)
    panel.set_aspect("equal")


def _ranges(stories: Sequence[int], names: Sequence[str]) -> str:
    """Such as "S1 to S3, S5"."""
    pairs = groupby(enumerate(stories), lambda pair: pair[1] - pair[0])
    runs = [[story for _, story in run] for _, run in pairs]
    texts = [names[run[0]] + (f" to {names[run[-1]]}" if len(run) > 1 else "") for run in runs]
    return ", ".join(texts)


@styled
def stick_mode_shapes(
    levels: Floats,
    shapes: Floats,
    headings: Sequence[str],
    floors: Sequence[str],
    *,
    shapes_sd: Floats | None = None,
    title: str = "Mode shapes",
) -> Figure:
    """Draw the modes of a building that is a stick of masses, each with its top to the right.

    Args:
        levels: (f,) heights of the floors, m, the base first.
        shapes: (k, f) mean mode shapes, any scale.
        headings: k texts over the modes: number, frequency, share of the mass.
        floors: f names, the base first.
        shapes_sd: (k, f) standard deviations in the scale of the shapes, or None.
    """
    count, shown = len(shapes), upright(shapes)
    largest = np.maximum(np.abs(shapes).max(axis=1, keepdims=True), 1e-300)
    figure = new_figure(max(1.55 * count + 0.8, 4.6), 4.0)
    axes = figure.subplots(1, count, sharey=True, sharex=True, squeeze=False)[0]
    for mode, panel in enumerate(axes):
        shape, label = shown[mode], "Shape" if shapes_sd is None else "Posterior mean"
        look: dict[str, Any] = {"linewidth": 1.8, "markersize": 6.0, "zorder": 2.2}
        panel.plot(shape, levels, "o-", color=BLUE, label=label, **look)
        if shapes_sd is not None:
            spread = 2.0 * shapes_sd[mode] / largest[mode]
            panel.fill_betweenx(levels, shape - spread, shape + spread, label="± 2 sd", **BAND)
        look = {"linewidth": 0.8, "markersize": 3.0}
        panel.plot(np.zeros_like(levels), levels, "o-", color=QUIET, label="At rest", **look)
        panel.set_title(headings[mode], fontweight="normal")
        panel.spines["left"].set_visible(False)
        panel.tick_params(axis="y", length=0)
        panel.set(xticks=(-1.0, 0.0, 1.0))
    widest = max(1.0, *(abs(bound) for bound in axes[0].get_xlim()))
    axes[0].set_xlim(-1.05 * widest, 1.05 * widest)
    axes[0].set(yticks=levels, yticklabels=floors)
    figure.supxlabel("Displacement over its largest", fontsize=10.0)
    thin = "" if shapes_sd is None else thin_band_note(2.0 * nearly_all(shapes_sd / largest))
    add_head(figure, title, note=thin)
    return figure


def upright(shapes: Floats) -> Floats:
    """Shapes (k, f) over their largest, their tops to the right: the sign of a mode is free."""
    largest = np.maximum(np.abs(shapes).max(axis=1, keepdims=True), 1e-300)
    return np.asarray(np.where(shapes[:, -1:] < 0.0, -1.0, 1.0) * shapes / largest)
