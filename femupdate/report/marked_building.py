"""A building with signs on it, in one panel of a figure."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from femupdate.arrays import Floats
from femupdate.report import drawing_pyvista
from femupdate.report.drawing_matplotlib import project
from femupdate.report.figure import show
from femupdate.report.geometry import Geometry, outline
from femupdate.report.glyphs import Glyphs
from femupdate.report.rendering import Renderer, renders
from femupdate.report.style import FAINT, INK, ORANGE, QUIET

_LABEL_GAP = 0.05  # between a building and the names of its floors, over its size


def draw_marked(
    panel: Axes,
    geometry: Geometry,
    glyphs: Glyphs,
    floors: Sequence[tuple[str, float]],
    renderer: Renderer = "auto",
) -> None:
    """Draw a building in grey, with signs and the names of its floors.

    PyVista renders it; where that is not possible matplotlib draws the same.

    Args:
        panel: to draw into.
        geometry: of the building.
        glyphs: drawn in a colour of their own.
        floors: names and heights, m.
        renderer: "auto", or one of the two by name.
    """
    panel.set_axis_off()
    names = [name for name, _ in floors]
    places = _labels_at(geometry, [height for _, height in floors])
    if renders(renderer):
        show([panel], [drawing_pyvista.render_marked(geometry, glyphs, names, places)])
        return
    _draw(panel, geometry, glyphs)
    for name, (x, y) in zip(names, project(places)[0], strict=True):
        panel.text(x, y, name, ha="right", va="center", fontsize=9, color=INK)
    panel.set_aspect("equal")


def _labels_at(geometry: Geometry, heights: Sequence[float]) -> Floats:
    """(f, 3) left of every floor as it is seen."""
    low, high = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
    gap = _LABEL_GAP * geometry.size
    return np.array([[low[0] - gap, high[1] + gap, low[2] + height] for height in heights])


def _draw(panel: Axes, geometry: Geometry, glyphs: Glyphs) -> None:
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
