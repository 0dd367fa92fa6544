"""Pictures of the building as it moves, and with signs of what is added to it."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report.figure import (
    FAINT,
    INK,
    MAGNITUDE_MAP,
    ORANGE,
    QUIET,
    SPREAD_MAP,
    add_head,
    new_figure,
    styled,
)
from femupdate.report.geometry import (
    DEFORMATION,
    VIEW,
    Geometry,
    Glyphs,
    Landmarks,
    deformed,
    outline,
)


def draw(
    panel: Axes, geometry: Geometry, moved: Floats, values: Floats, color_map: str, top: float
) -> None:
    """Draw the building into a panel, at rest as a grey outline.

    Args:
        moved: (N, 3) where its nodes are drawn.
        values: (N,) what colours it, from 0 to `top`.
        top: value of the last colour.
    """
    flat, depth = project(moved)
    colors = matplotlib.colormaps[color_map]
    pieces = [*geometry.shells, *geometry.beams]
    is_shell = np.arange(len(pieces)) < len(geometry.shells)

    def means(at_nodes: Floats) -> Floats:
        parts = (at_nodes[part].mean(axis=1) for part in (geometry.shells, geometry.beams))
        return np.concatenate(list(parts))

    # A beam in the plane of a slab or wall must not vanish behind it.
    order = np.argsort(means(depth) + np.where(is_shell, 0.0, 0.02 * geometry.size), kind="stable")
    face = colors(means(values) / top)
    edge = np.where(is_shell[:, None], (0.2, 0.22, 0.25, 0.3), face)
    panel.add_collection(
        LineCollection(
            list(project(geometry.nodes)[0][outline(geometry)]),
            colors=QUIET,
            linewidths=0.7,
            alpha=0.5,
            zorder=1.0,
        )
    )
    panel.add_collection(
        PolyCollection(
            [flat[pieces[i]] for i in order],
            facecolors=face[order],
            edgecolors=edge[order],
            linewidths=np.where(is_shell, 0.3, 2.2)[order],
            zorder=2.0,
        )
    )
    panel.autoscale_view()
    panel.set_aspect("equal")


def mark(panel: Axes, marks: Landmarks) -> None:
    """Draw names and axes."""
    lines = [project(axis)[0] for axis in marks.axes]
    panel.add_collection(LineCollection(lines, colors=INK, linewidths=1.2))
    places = project(marks.places)[0]
    panel.update_datalim(places)
    for name, (x, y) in zip(marks.names, places, strict=True):
        beside = "center" if name in "xyz" else "right"
        panel.text(x, y, name, ha=beside, va="center", fontsize=9, color=INK)
    panel.autoscale_view()


def project(points: Floats) -> tuple[Floats, Floats]:
    """Return the points (N, 2) as seen, up being up, and their nearness (N,) to the eye."""
    towards = np.asarray(VIEW) / np.linalg.norm(VIEW)
    right = np.cross((0.0, 0.0, 1.0), towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    return points @ np.stack([right, up], axis=1), points @ towards


@styled
def mode_shape_figure(
    geometry: Geometry,
    shape_mean: Floats,
    floors: Sequence[tuple[str, float]],
    *,
    shape_sd: Floats | None = None,
    title: str = "Mode shape",
) -> Figure:
    """Draw a mode shape, and beside it its spread across posterior samples.

    Args:
        shape_mean: (N, 3) displacement of every node, any scale.
        floors: names and heights, m.
        shape_sd: (N,) standard deviation of the displacement, in the scale of the mean, or None.
    """
    magnitude, moved = np.linalg.norm(shape_mean, axis=1), deformed(geometry, shape_mean)
    largest = magnitude.max() or 1.0
    # Of every panel: heading, label of its colours, values, where the colours end, and their map.
    label = "Displacement over its largest"
    heading = "Shape" if shape_sd is None else "Mean shape"
    fields = [(heading, label, magnitude / largest, 1.0, MAGNITUDE_MAP)]
    if shape_sd is not None:
        percent = 100.0 * shape_sd / largest
        label = "Standard deviation, % of the largest displacement"
        top = percent.max() or 1.0
        fields.append(("Spread of the posterior", label, percent, top, SPREAD_MAP))
    marks = Landmarks.of(geometry, floors, 0.7 * DEFORMATION * geometry.size)
    # As high as the building is, seen at this width, and the bar of colours.
    seen = np.ptp(project(np.concatenate([moved, marks.places]))[0], axis=0)
    high = float(np.clip(5.0 * seen[1] / seen[0] + 1.0, 3.0, 6.3))
    figure = new_figure(5.4 * len(fields), high)
    panels = figure.subplots(1, len(fields), squeeze=False)[0]
    for panel, (heading, label, values, top, colors) in zip(panels, fields, strict=True):
        draw(panel, geometry, moved, values, colors, top)
        mark(panel, marks)
        panel.set_axis_off()
        panel.set_title(heading)
        scale = ScalarMappable(Normalize(0.0, top), colors)
        bars: dict[str, Any] = {
            "orientation": "horizontal",
            "shrink": 0.72,
            "aspect": 32,
            "pad": 0.02,
        }
        bar = figure.colorbar(scale, ax=panel, **bars)
        bar.outline.set_visible(False)
        bar.set_label(label)
    add_head(figure, title, note="Displacements are enlarged; grey lines: the building at rest")
    return figure


def draw_marked(
    panel: Axes, geometry: Geometry, glyphs: Glyphs, floors: Sequence[tuple[str, float]]
) -> None:
    """Draw a building in grey into a panel, with signs, axes and floors (names and heights, m)."""
    panel.set_axis_off()
    marks = Landmarks.of(geometry, floors)
    flat = project(geometry.nodes)[0]
    shells = PolyCollection(list(flat[geometry.shells]), facecolors=FAINT, alpha=0.25, zorder=1.0)
    panel.add_collection(shells)
    edges = LineCollection(list(flat[outline(geometry)]), colors=QUIET, linewidths=0.8, zorder=2.0)
    panel.add_collection(edges)
    faces = [project(face)[0] for face in glyphs.faces]
    panel.add_collection(PolyCollection(faces, facecolors=ORANGE, alpha=0.55, zorder=3.0))
    lines = [project(line)[0] for line in glyphs.lines]
    panel.add_collection(LineCollection(lines, colors=ORANGE, linewidths=2.4, zorder=4.0))
    panel.autoscale_view()
    circle = np.linspace(0.0, 2.0 * np.pi, 40)
    rim = np.column_stack([np.cos(circle), np.sin(circle)])
    balls = [project(centre[None])[0] + radius * rim for centre, radius in glyphs.balls]
    panel.add_collection(PolyCollection(balls, facecolors=ORANGE, zorder=5.0))
    panel.autoscale_view()
    mark(panel, marks)
    panel.set_aspect("equal")
