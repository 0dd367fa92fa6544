"""Mode shapes that move, as GIF files."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from femupdate.arrays import Floats, Pixels
from femupdate.errors import ReportError
from femupdate.report import drawing
from femupdate.report.drawing import Renderer, renders
from femupdate.report.figure import add_head, new_figure, show
from femupdate.report.geometry import Geometry, deformed
from femupdate.report.plot_sticks import mark_floors, upright
from femupdate.report.style import BLUE, MAGNITUDE_MAP, QUIET, styled
from femupdate.storage import write_bytes

FRAMES = 16  # of a cycle


@styled
def mode_animation(
    geometry: Geometry,
    shape: Floats,
    path: Path,
    *,
    title: str = "Mode shape",
    renderer: Renderer = "auto",
) -> Path:
    """Write one cycle of a mode of a mesh, which repeats.

    Args:
        shape: (N, 3) displacement of every node, any scale.
        renderer: as for `mode_shape_figure`.

    Raises:
        ReportError: the file cannot be written.
    """
    size = np.linalg.norm(shape, axis=1)
    moved = deformed(geometry, shape) - geometry.nodes
    # The way back shows the same pictures.
    phases = np.cos(2.0 * np.pi * np.arange(FRAMES // 2 + 1) / FRAMES)
    states = [(geometry.nodes + c * moved, size / (size.max() or 1.0)) for c in phases]
    figures = [new_figure(5.4, 6.0) for _ in states]
    panels = [figure.subplots() for figure in figures]
    for panel in panels:
        panel.set_axis_off()
    if renders(renderer):
        pictures = drawing.render_sequence(geometry, states, MAGNITUDE_MAP, 1.0)
        show(panels, list(pictures))
    else:
        # The first state reaches farthest to one side, the last to the other.
        ends = [drawing.project(states[k][0])[0] for k in (0, -1)]
        reach = np.concatenate(ends)
        room = 0.03 * np.ptp(reach, axis=0)
        limits = np.stack([reach.min(axis=0) - room, reach.max(axis=0) + room], axis=1)
        for panel, state in zip(panels, states, strict=True):
            drawing.draw(panel, geometry, *state, MAGNITUDE_MAP, 1.0)
            panel.set(xlim=limits[0], ylim=limits[1])
    return _write([_frame(figure, title) for figure in figures], path)


@styled
def stick_animation(
    levels: Floats,
    shapes: Floats,
    headings: Sequence[str],
    floors: Sequence[str],
    path: Path,
) -> Path:
    """Write one cycle of the modes of a stick side by side, each with its largest point at one.

    Args:
        levels: (f,) heights, m, the base first.
        shapes: (k, f), any scale.
        headings: k texts over the modes.
        floors: f names, the base first.

    Raises:
        ReportError: the file cannot be written.
    """
    each, frames = upright(shapes), []
    for c in np.cos(2.0 * np.pi * np.arange(FRAMES // 2 + 1) / FRAMES):
        figure = new_figure(max(1.55 * len(headings) + 0.8, 4.6), 4.0)
        panels = figure.subplots(1, len(headings), sharey=True, squeeze=False)[0]
        for panel, shape, heading in zip(panels, each, headings, strict=True):
            panel.plot(np.zeros_like(levels), levels, color=QUIET, linewidth=0.8)
            panel.plot(c * shape, levels, "o-", color=BLUE)
            panel.set(xlim=(-1.15, 1.15), xticks=(-1.0, 0.0, 1.0))
            panel.set_title(heading, fontweight="normal")
        mark_floors(panels[0], levels, floors)
        frames.append(_frame(figure, "Mode shapes, displacement over its largest"))
    return _write(frames, path)


def _frame(figure: Figure, title: str) -> Pixels:
    """The pixels (h, w, 3) of a figure under its title."""
    add_head(figure, title)
    # A third of the pixels of a picture.
    figure.set_dpi(80)
    canvas: Any = figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _write(half: Sequence[Pixels], path: Path) -> Path:
    """Write half a cycle and the way back."""
    from PIL import Image

    frames = [*half, *half[-2:0:-1]]
    first, *others = [Image.fromarray(frame).quantize(128) for frame in frames]
    content = BytesIO()
    look: dict[str, Any] = {"duration": 80, "loop": 0, "optimize": True}
    first.save(content, format="GIF", save_all=True, append_images=others, **look)
    write_bytes(path, content.getvalue(), ReportError)
    return path
