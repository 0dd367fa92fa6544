"""Pictures of mode shapes: the mean of the posterior, and how much its samples differ."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from femupdate.arrays import Floats, Pixels
from femupdate.report import drawing_matplotlib, drawing_pyvista
from femupdate.report.figure import add_head, checked, new_figure, save_figure
from femupdate.report.geometry import Geometry, deformed
from femupdate.report.rendering import rendering
from femupdate.report.style import MAGNITUDE_MAP, SPREAD_MAP, styled

Renderer = Literal["auto", "pyvista", "matplotlib"]
MARGIN = 12  # white pixels left around a rendered building


@dataclass(frozen=True)
class _Field:
    """What colours one panel."""

    heading: str
    label: str
    values: Floats
    top: float
    color_map: str


def mode_shape_scene(
    geometry: Geometry,
    shape_mean: ArrayLike,
    path: str | Path,
    *,
    shape_sd: ArrayLike | None = None,
    title: str = "Mode shape",
    renderer: Renderer = "auto",
) -> Path:
    """Write a picture of a mode shape, and beside it of its spread across posterior samples.

    PyVista renders it off screen; where that is not possible matplotlib draws the same.

    Args:
        geometry: the building.
        shape_mean: (N, 3) displacement of every node, any scale.
        path: of the PNG.
        shape_sd: (N,) standard deviation of the displacement, in the scale of the mean, or None.
        title: over the picture.
        renderer: "auto", or one of the two by name.

    Raises:
        ReportError: an array has another shape, or the picture cannot be written.
    """
    figure = mode_shape_figure(
        geometry, shape_mean, shape_sd=shape_sd, title=title, renderer=renderer
    )
    return save_figure(figure, path)


@styled
def mode_shape_figure(
    geometry: Geometry,
    shape_mean: ArrayLike,
    *,
    shape_sd: ArrayLike | None = None,
    title: str = "Mode shape",
    renderer: Renderer = "auto",
) -> Figure:
    """Return the figure that `mode_shape_scene` writes; arguments and errors as there."""
    count = len(geometry.nodes)
    shape = checked("shape_mean", shape_mean, count, 3)
    fields = _fields(shape, None if shape_sd is None else checked("shape_sd", shape_sd, count))
    moved = deformed(geometry, shape)
    figure = new_figure(5.4 * len(fields), 6.3)
    panels = figure.subplots(1, len(fields), squeeze=False)[0]
    if renderer == "pyvista" or (renderer == "auto" and rendering().works):
        _show(panels, [_rendered(geometry, moved, field) for field in fields])
    else:
        for panel, field in zip(panels, fields, strict=True):
            drawing_matplotlib.draw(
                panel, geometry, moved, field.values, field.color_map, field.top
            )
    for panel, field in zip(panels, fields, strict=True):
        _finish(figure, panel, field)
    add_head(figure, title, note="Displacements are enlarged; grey lines: the building at rest")
    return figure


def _fields(shape: Floats, sd: Floats | None) -> list[_Field]:
    magnitude = np.linalg.norm(shape, axis=1)
    largest = magnitude.max() or 1.0
    label = "Displacement over its largest"
    fields = [_Field("Mean shape", label, magnitude / largest, 1.0, MAGNITUDE_MAP)]
    if sd is not None:
        percent = 100.0 * sd / largest
        top = percent.max() or 1.0
        label = "Standard deviation (% of the largest displacement)"
        fields.append(_Field("Spread of the posterior", label, percent, top, SPREAD_MAP))
    return fields


def _rendered(geometry: Geometry, moved: Floats, field: _Field) -> Pixels:
    return drawing_pyvista.render(geometry, moved, field.values, field.color_map, field.top)


def _show(panels: Sequence[Axes], pictures: list[Pixels]) -> None:
    """Show rendered pictures, all cut to the same window so that they stay comparable."""
    ink = np.any([picture.min(axis=-1) < 250 for picture in pictures], axis=0)
    rows, columns = (np.flatnonzero(ink.any(axis=axis)) for axis in (1, 0))
    window = tuple(
        slice(max(0, found[0] - MARGIN), found[-1] + MARGIN) if len(found) else slice(None)
        for found in (rows, columns)
    )
    for panel, picture in zip(panels, pictures, strict=True):
        panel.imshow(picture[window], interpolation="lanczos")


def _finish(figure: Figure, panel: Axes, field: _Field) -> None:
    panel.set_axis_off()
    panel.set_title(field.heading)
    colors = ScalarMappable(Normalize(0.0, field.top), field.color_map)
    bar = figure.colorbar(
        colors, ax=panel, orientation="horizontal", shrink=0.72, aspect=32, pad=0.02
    )
    bar.outline.set_visible(False)
    bar.set_label(field.label)
