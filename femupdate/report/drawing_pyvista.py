"""The building rendered off screen by PyVista."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from femupdate.arrays import Floats, Integers, Pixels
from femupdate.report.geometry import VIEW, Geometry, Landmarks, mesh_lines, outline
from femupdate.report.glyphs import Glyphs
from femupdate.report.style import FAINT, INK, ORANGE, QUIET

WINDOW = (1200, 1300)
TUBE = 0.006  # radius of a beam over the size of the building


def render(
    geometry: Geometry,
    moved: Floats,
    values: Floats,
    color_map: str,
    top: float,
    marks: Landmarks = Landmarks(),  # noqa: B008 - frozen
) -> Pixels:
    """Return a picture (h, w, 3) of the building, white around.

    Args:
        geometry: the building at rest, drawn as a grey outline.
        moved: (N, 3) where its nodes are drawn.
        values: (N,) what colours it, from 0 to `top`.
        color_map: name of a matplotlib colour map.
        top: value of the last colour.
        marks: names and axes beside the building.
    """
    return next(render_sequence(geometry, [(moved, values)], color_map, top, marks))


def render_sequence(
    geometry: Geometry,
    states: Sequence[tuple[Floats, Floats]],
    color_map: str,
    top: float,
    marks: Landmarks = Landmarks(),  # noqa: B008 - frozen
) -> Iterator[Pixels]:
    """Yield a picture (h, w, 3) of each state, all seen from where the first fills the picture.

    Args:
        geometry: the building at rest, drawn as a grey outline.
        states: of each (N, 3) where its nodes are drawn, and (N,) what colours it, to `top`.
        color_map: name of a matplotlib colour map.
        top: value of the last colour.
    """
    look = {
        "scalars": "value",
        "cmap": color_map,
        "clim": (0.0, top),
        "lighting": False,  # shades would be read as values
        "show_scalar_bar": False,
        "reset_camera": False,
    }
    fine = len(states) == 1
    with _plotter(fine) as (pyvista, plotter):
        for number, (moved, values) in enumerate(states):
            plotter.clear_actors()
            for mesh in _meshes(pyvista, geometry, moved, values):
                plotter.add_mesh(mesh, **look)
            for points, lines, line_look in _wires(geometry, moved):
                wires = _lines(pyvista, points, lines)
                plotter.add_mesh(wires, color=INK, lighting=False, reset_camera=False, **line_look)
            _mark(pyvista, plotter, marks)
            if number == 0:
                _look_at(plotter)
            yield np.asarray(plotter.screenshot(return_img=True))[..., :3]


def render_marked(geometry: Geometry, glyphs: Glyphs, marks: Landmarks) -> Pixels:
    """Return a picture (h, w, 3) of a building in grey with signs on it, white around.

    Args:
        glyphs: drawn in a colour of their own.
        marks: names and axes beside the building.
    """
    with _plotter() as (pyvista, plotter):
        if len(geometry.shells):
            shells = _quads(pyvista, geometry.nodes, geometry.shells)
            plotter.add_mesh(shells, color=FAINT, opacity=0.3, lighting=False)
        wires = _lines(pyvista, geometry.nodes, outline(geometry))
        plotter.add_mesh(wires, color=QUIET, line_width=2.5, lighting=False)
        for mesh in _signs(pyvista, geometry, glyphs):
            plotter.add_mesh(mesh, color=ORANGE, ambient=0.35)
        _mark(pyvista, plotter, marks)
        _look_at(plotter)
        return np.asarray(plotter.screenshot(return_img=True))[..., :3]


@contextmanager
def _plotter(fine: bool = True) -> Iterator[tuple[Any, Any]]:
    """PyVista, imported where it is needed, and an empty white picture, small if not fine."""
    with _quiet_vtk():
        import pyvista

        plotter: Any = pyvista.Plotter(
            off_screen=True, window_size=[pixels if fine else pixels // 2 for pixels in WINDOW]
        )
        try:
            plotter.set_background("white")
            if fine:
                plotter.enable_anti_aliasing("ssaa")
            yield pyvista, plotter
        finally:
            plotter.close()


def _look_at(plotter: Any) -> None:
    plotter.enable_parallel_projection()
    plotter.view_vector(VIEW, viewup=(0.0, 0.0, 1.0))


def _mark(pyvista: Any, plotter: Any, marks: Landmarks) -> None:
    if not marks.names:
        return
    look = {"text_color": INK, "font_size": 34, "shape": None, "show_points": False}
    plotter.add_point_labels(marks.places, list(marks.names), always_visible=True, **look)
    # Labels do not widen what the camera takes in: points that nobody sees do.
    plotter.add_mesh(pyvista.PolyData(marks.places), opacity=0.0)
    ends = np.arange(2 * len(marks.axes)).reshape(-1, 2)
    axes = _lines(pyvista, marks.axes.reshape(-1, 3), ends)
    plotter.add_mesh(axes, color=INK, line_width=3.0, lighting=False)


def _quads(pyvista: Any, points: Floats, quads: Integers) -> Any:
    return pyvista.PolyData(points, faces=np.insert(quads, 0, 4, axis=1).ravel())


def _signs(pyvista: Any, geometry: Geometry, glyphs: Glyphs) -> Iterator[Any]:
    for centre, radius in glyphs.balls:
        yield pyvista.Sphere(radius=radius, center=centre)
    for line in glyphs.lines:
        radius = 1.4 * TUBE * geometry.size
        yield pyvista.lines_from_points(line).tube(radius=radius, n_sides=12)
    if glyphs.faces:
        corners = np.concatenate(glyphs.faces)
        quads = np.arange(len(corners)).reshape(-1, 4)
        yield _quads(pyvista, corners, quads)


def _meshes(pyvista: Any, geometry: Geometry, moved: Floats, values: Floats) -> Iterator[Any]:
    if len(geometry.shells):
        shells = _quads(pyvista, moved, geometry.shells)
        shells.point_data["value"] = values
        yield shells
    if len(geometry.beams):
        beams = _lines(pyvista, moved, geometry.beams)
        beams.point_data["value"] = values
        yield beams.tube(radius=TUBE * geometry.size, n_sides=12)


def _wires(
    geometry: Geometry, moved: Floats
) -> Iterator[tuple[Floats, Integers, dict[str, float]]]:
    """Points, lines and look of the building at rest, of the mesh and of the moved outline."""
    edges = outline(geometry)
    # Lines on a surface are lifted towards the eye: else they sink in and out.
    lifted = moved + 0.006 * geometry.size * np.asarray(VIEW)
    yield geometry.nodes, edges, {"opacity": 0.4, "line_width": 2.0}
    if len(geometry.shells):
        yield lifted, mesh_lines(geometry), {"opacity": 0.35, "line_width": 2.0}
    yield lifted, edges, {"opacity": 0.6, "line_width": 2.5}


def _lines(pyvista: Any, points: Floats, lines: Integers) -> Any:
    return pyvista.PolyData(points, lines=np.insert(lines, 0, 2, axis=1).ravel())


@contextmanager
def _quiet_vtk() -> Iterator[None]:
    """Keep VTK from writing to stderr about each graphics library that it tries and misses."""
    from vtkmodules.vtkCommonCore import vtkLogger

    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)
