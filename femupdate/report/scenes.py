"""Pictures of the building, by PyVista off screen, or by matplotlib where nothing can render."""

import functools
import logging
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from femupdate.arrays import Floats, Integers, Pixels
from femupdate.report.figure import (
    FAINT,
    INK,
    ORANGE,
    QUIET,
    add_head,
    new_figure,
    show,
    styled,
)
from femupdate.report.geometry import (
    DEFORMATION,
    MAGNITUDE_MAP,
    SPREAD_MAP,
    VIEW,
    Geometry,
    Glyphs,
    Landmarks,
    deformed,
    mesh_lines,
    outline,
)


def draw(
    panel: Axes, geometry: Geometry, moved: Floats, values: Floats, color_map: str, top: float
) -> None:
    """Draw the building into a panel; arguments as for the rendered picture."""
    flat, depth = project(moved)
    colors = matplotlib.colormaps[color_map]
    pieces = [*geometry.shells, *geometry.beams]
    is_shell = np.arange(len(pieces)) < len(geometry.shells)
    far = np.array([depth[piece].mean() for piece in pieces])
    # A beam in the plane of a slab or wall must not vanish behind it.
    order = np.argsort(far + np.where(is_shell, 0.0, 0.02 * geometry.size), kind="stable")
    face = colors(np.array([values[piece].mean() for piece in pieces]) / top)
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


WINDOW = (1200, 1300)
TUBE = 0.006  # radius of a beam over the size of the building


def render(
    geometry: Geometry,
    moved: Floats,
    values: Floats,
    color_map: str,
    top: float,
    marks: Landmarks,
) -> Pixels:
    """Return a picture (h, w, 3) of the building, white around.

    Args:
        geometry: the building at rest, drawn as a grey outline.
        moved: (N, 3) where its nodes are drawn.
        values: (N,) what colours it, from 0 to `top`.
        top: value of the last colour.
        marks: names and axes beside the building.
    """
    look = {
        "scalars": "value",
        "cmap": color_map,
        "clim": (0.0, top),
        "lighting": False,  # shades would be read as values
        "show_scalar_bar": False,
    }
    with _plotter() as (pyvista, plotter):
        if len(geometry.shells):
            faces = np.insert(geometry.shells, 0, 4, axis=1).ravel()
            shells = pyvista.PolyData(moved, faces=faces)
            shells.point_data["value"] = values
            plotter.add_mesh(shells, **look)
        if len(geometry.beams):
            beams = _lines(pyvista, moved, geometry.beams)
            beams.point_data["value"] = values
            plotter.add_mesh(beams.tube(radius=TUBE * geometry.size, n_sides=12), **look)
        # At rest, the mesh and the outline as moved. Lines on a surface are lifted towards the
        # eye: else they sink in and out.
        lifted, edges = moved + 0.006 * geometry.size * np.asarray(VIEW), outline(geometry)
        wires = [(geometry.nodes, edges, 0.4, 2.0), (lifted, edges, 0.6, 2.5)]
        if len(geometry.shells):
            wires.insert(1, (lifted, mesh_lines(geometry), 0.35, 2.0))
        for points, lines, opacity, width in wires:
            how = {"opacity": opacity, "line_width": width}
            plotter.add_mesh(_lines(pyvista, points, lines), color=INK, lighting=False, **how)
        return _picture(pyvista, plotter, marks)


@contextmanager
def _plotter() -> Iterator[tuple[Any, Any]]:
    """PyVista, imported where it is needed, and an empty white picture."""
    from vtkmodules.vtkCommonCore import vtkLogger

    # VTK would write to stderr about each graphics library that it tries and misses.
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        import pyvista

        plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(WINDOW))
        try:
            plotter.set_background("white")
            plotter.enable_anti_aliasing("ssaa")
            yield pyvista, plotter
        finally:
            plotter.close()
    finally:
        vtkLogger.SetStderrVerbosity(before)


def _picture(pyvista: Any, plotter: Any, marks: Landmarks) -> Pixels:
    """The picture (h, w, 3) with names and axes, seen so that all of it fills the picture."""
    look = {"text_color": INK, "font_size": 34, "shape": None, "show_points": False}
    plotter.add_point_labels(marks.places, list(marks.names), always_visible=True, **look)
    # Labels do not widen what the camera takes in: points that nobody sees do.
    plotter.add_mesh(pyvista.PolyData(marks.places), opacity=0.0)
    ends = np.arange(2 * len(marks.axes)).reshape(-1, 2)
    axes = _lines(pyvista, marks.axes.reshape(-1, 3), ends)
    plotter.add_mesh(axes, color=INK, line_width=3.0, lighting=False)
    plotter.enable_parallel_projection()
    plotter.view_vector(VIEW, viewup=(0.0, 0.0, 1.0))
    return np.asarray(plotter.screenshot(return_img=True))[..., :3]


def _lines(pyvista: Any, points: Floats, lines: Integers) -> Any:
    return pyvista.PolyData(points, lines=np.insert(lines, 0, 2, axis=1).ravel())


logger = logging.getLogger(__name__)

Renderer = Literal["auto", "pyvista", "matplotlib"]

ADVICE = (
    "to render with PyVista install libegl1 and libgl1-mesa-dri, or libosmesa6 "
    "(Debian and Ubuntu packages)"
)
# By VTK alone: PyVista takes a second to be imported.
_PROBE = """
import vtkmodules.vtkRenderingCore as vtk, vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkFiltersSources import vtkSphereSource
sphere, mapper, actor = vtkSphereSource(), vtk.vtkPolyDataMapper(), vtk.vtkActor()
renderer, window, image = vtk.vtkRenderer(), vtk.vtkRenderWindow(), vtk.vtkWindowToImageFilter()
mapper.SetInputConnection(sphere.GetOutputPort())
actor.SetMapper(mapper)
renderer.AddActor(actor)
window.SetOffScreenRendering(1)
window.AddRenderer(renderer)
window.Render()
image.SetInput(window)
image.Update()
raise SystemExit(3 if image.GetOutput().GetScalarRange()[1] == 0.0 else 0)
"""


@functools.lru_cache(maxsize=1)
def rendering() -> str:
    """Why PyVista cannot render off screen here, for as long as the process lives; empty if it can.

    Without graphics libraries VTK crashes at its first picture instead of raising an error, so the
    first picture is made in a process of its own. Where it fails, the log says what to install.
    """
    reason = probe((sys.executable, "-P", "-c", _PROBE))
    if reason:
        logger.warning("PyVista cannot render here (%s): %s", reason, ADVICE)
    return reason


def probe(command: tuple[str, ...], timeout: float = 60.0) -> str:
    """Run a command that makes a picture; why it did not live, as half a sentence."""
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no picture within {timeout:.0f} s"
    except OSError as error:
        return f"no process could be started: {error.strerror}"
    code = done.returncode
    if code in (0, 3):
        return "the first picture is blank" if code else ""
    if code < 0 or code > 128:
        return "the first picture crashes"
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else f"exit status {code}"


@styled
def mode_shape_figure(
    geometry: Geometry,
    shape_mean: Floats,
    floors: Sequence[tuple[str, float]],
    *,
    shape_sd: Floats | None = None,
    title: str = "Mode shape",
    renderer: Renderer = "auto",
) -> Figure:
    """Draw a mode shape, and beside it its spread across posterior samples.

    PyVista renders it off screen; where that is not possible matplotlib draws the same.

    Args:
        shape_mean: (N, 3) displacement of every node, any scale.
        floors: names and heights, m.
        shape_sd: (N,) standard deviation of the displacement, in the scale of the mean, or None.
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
    marks = Landmarks.of(geometry, floors, 0.7 * DEFORMATION * geometry.size)
    # As high as the building is, seen at this width, and the bar of colours.
    seen = np.ptp(project(np.concatenate([moved, marks.places]))[0], axis=0)
    high = float(np.clip(5.0 * seen[1] / seen[0] + 1.0, 3.0, 6.3))
    figure = new_figure(5.4 * len(fields), high)
    panels = figure.subplots(1, len(fields), squeeze=False)[0]
    looks = [(geometry, moved, values, colors, top) for _, _, values, top, colors in fields]
    if renderer == "pyvista" or (renderer == "auto" and not rendering()):
        show(panels, [render(*look, marks) for look in looks])
    else:
        for panel, look in zip(panels, looks, strict=True):
            draw(panel, *look)
            mark(panel, marks)
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
