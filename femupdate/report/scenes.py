"""Pictures of the building: mode shapes with their spread, and signs of what was added."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report import drawing
from femupdate.report.drawing import Renderer, project, renders
from femupdate.report.figure import (
    FAINT,
    MAGNITUDE_MAP,
    ORANGE,
    QUIET,
    SPREAD_MAP,
    add_head,
    new_figure,
    show,
    styled,
)
from femupdate.report.geometry import DEFORMATION, Geometry, Glyphs, Landmarks, deformed, outline


@styled
def mode_shape_figure(
    geometry: Geometry,
    shape_mean: Floats,
    *,
    shape_sd: Floats | None = None,
    floors: Sequence[tuple[str, float]] = (),
    title: str = "Mode shape",
    renderer: Renderer = "auto",
) -> Figure:
    """Draw a mode shape, and beside it its spread across posterior samples.

    PyVista renders it off screen; where that is not possible matplotlib draws the same.

    Args:
        shape_mean: (N, 3) displacement of every node, any scale.
        shape_sd: (N,) standard deviation of the displacement, in the scale of the mean, or None.
        floors: names and heights, m; without them no axes are drawn either.
        renderer: "auto", or one of the two by name.
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
    marks = Landmarks()
    if floors:
        marks = Landmarks.of(geometry, floors, 0.7 * DEFORMATION * geometry.size)
    # As high as the building is, seen at this width, and the bar of colours.
    seen = np.ptp(project(np.concatenate([moved, marks.places]))[0], axis=0)
    high = float(np.clip(5.0 * seen[1] / seen[0] + 1.0, 3.0, 6.3))
    figure = new_figure(5.4 * len(fields), high)
    panels = figure.subplots(1, len(fields), squeeze=False)[0]
    looks = [(geometry, moved, values, colors, top) for _, _, values, top, colors in fields]
    if renders(renderer):
        show(panels, [drawing.render(*look, marks) for look in looks])
    else:
        for panel, look in zip(panels, looks, strict=True):
            drawing.draw(panel, *look)
            drawing.mark(panel, marks)
    for panel, (heading, label, _, top, colors) in zip(panels, fields, strict=True):
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
    panel: Axes,
    geometry: Geometry,
    glyphs: Glyphs,
    floors: Sequence[tuple[str, float]],
    renderer: Renderer = "auto",
) -> None:
    """Draw a building in grey, with signs, axes and the names of its floors.

    PyVista renders it; where that is not possible matplotlib draws the same.

    Args:
        panel: to draw into.
        geometry: of the building.
        glyphs: drawn in a colour of their own.
        floors: names and heights, m.
        renderer: "auto", or one of the two by name.
    """
    panel.set_axis_off()
    marks = Landmarks.of(geometry, floors)
    if renders(renderer):
        show([panel], [drawing.render_marked(geometry, glyphs, marks)])
        return
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
    drawing.mark(panel, marks)
    panel.set_aspect("equal")
