"""Mode shapes that move, as GIF files."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from femupdate.arrays import Floats, Pixels
from femupdate.errors import ReportError
from femupdate.report import drawing_matplotlib, drawing_pyvista
from femupdate.report.figure import add_head, new_figure, show
from femupdate.report.geometry import Geometry, deformed
from femupdate.report.plot_sticks import mark_floors, upright
from femupdate.report.rendering import Renderer, renders
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
    stages = [_stage() for _ in states]
    panels = [panel for _, panel in stages]
    if renders(renderer):
        pictures = drawing_pyvista.render_sequence(geometry, states, MAGNITUDE_MAP, 1.0)
        show(panels, list(pictures))
    else:
        # The first state reaches farthest to one side, the last to the other.
        ends = [drawing_matplotlib.project(states[k][0])[0] for k in (0, -1)]
        reach = np.concatenate(ends)
        for panel, state in zip(panels, states, strict=True):
            drawing_matplotlib.draw(panel, geometry, *state, MAGNITUDE_MAP, 1.0)
            panel.set(xlim=_limits(reach[:, 0]), ylim=_limits(reach[:, 1]))
    return _write(_and_back([_frame(figure, title) for figure, _ in stages]), path)


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
    return _write(_and_back(frames), path)


def _and_back(frames: Sequence[Pixels]) -> list[Pixels]:
    """Half a cycle and the way back."""
    return [*frames, *frames[-2:0:-1]]


def _stage() -> tuple[Figure, Any]:
    figure = new_figure(5.4, 6.0)
    panel = figure.subplots()
    panel.set_axis_off()
    return figure, panel


def _limits(values: Floats) -> tuple[float, float]:
    room = 0.03 * float(np.ptp(values))
    return float(values.min()) - room, float(values.max()) + room


def _frame(figure: Figure, title: str) -> Pixels:
    """The pixels (h, w, 3) of a figure under its title."""
    add_head(figure, title)
    # A third of the pixels of a picture.
    figure.set_dpi(80)
    canvas: Any = figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _write(frames: Sequence[Pixels], path: Path) -> Path:
    from PIL import Image

    first, *others = [Image.fromarray(frame).quantize(128) for frame in frames]
    content = BytesIO()
    look: dict[str, Any] = {"duration": 80, "loop": 0, "optimize": True}
    first.save(content, format="GIF", save_all=True, append_images=others, **look)
    write_bytes(path, content.getvalue(), ReportError)
    return path
