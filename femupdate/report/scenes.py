"""Pictures of mode shapes: the mean of the posterior, and how much its samples differ."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report import drawing_matplotlib, drawing_pyvista
from femupdate.report.figure import add_head, new_figure, show
from femupdate.report.geometry import Geometry, deformed
from femupdate.report.rendering import Renderer, renders
from femupdate.report.style import MAGNITUDE_MAP, SPREAD_MAP, styled


@dataclass(frozen=True)
class _Field:
    """What colours one panel."""

    heading: str
    label: str
    values: Floats
    top: float
    color_map: str


@styled
def mode_shape_figure(
    geometry: Geometry,
    shape_mean: Floats,
    *,
    shape_sd: Floats | None = None,
    title: str = "Mode shape",
    note: str = "",
    renderer: Renderer = "auto",
) -> Figure:
    """Draw a mode shape, and beside it its spread across posterior samples.

    PyVista renders it off screen; where that is not possible matplotlib draws the same.

    Args:
        shape_mean: (N, 3) displacement of every node, any scale.
        shape_sd: (N,) standard deviation of the displacement, in the scale of the mean, or None.
        note: under the title, before how displacements are drawn.
        renderer: "auto", or one of the two by name.
    """
    fields, moved = _fields(shape_mean, shape_sd), deformed(geometry, shape_mean)
    figure = new_figure(5.4 * len(fields), 6.3)
    panels = figure.subplots(1, len(fields), squeeze=False)[0]
    looks = [(geometry, moved, field.values, field.color_map, field.top) for field in fields]
    if renders(renderer):
        show(panels, [drawing_pyvista.render(*look) for look in looks])
    else:
        for panel, look in zip(panels, looks, strict=True):
            drawing_matplotlib.draw(panel, *look)
    for panel, field in zip(panels, fields, strict=True):
        _finish(figure, panel, field)
    drawn = "Displacements are enlarged; grey lines: the building at rest"
    add_head(figure, title, note="\n".join(one for one in (note, drawn) if one))
    return figure


def _fields(shape: Floats, sd: Floats | None) -> list[_Field]:
    magnitude = np.linalg.norm(shape, axis=1)
    largest = magnitude.max() or 1.0
    label = "Displacement over its largest"
    heading = "Shape" if sd is None else "Mean shape"
    fields = [_Field(heading, label, magnitude / largest, 1.0, MAGNITUDE_MAP)]
    if sd is not None:
        percent = 100.0 * sd / largest
        top = percent.max() or 1.0
        label = "Standard deviation, % of the largest displacement"
        fields.append(_Field("Spread of the posterior", label, percent, top, SPREAD_MAP))
    return fields


def _finish(figure: Figure, panel: Axes, field: _Field) -> None:
    panel.set_axis_off()
    panel.set_title(field.heading)
    colors = ScalarMappable(Normalize(0.0, field.top), field.color_map)
    bar = figure.colorbar(
        colors, ax=panel, orientation="horizontal", shrink=0.72, aspect=32, pad=0.02
    )
    bar.outline.set_visible(False)
    bar.set_label(field.label)
