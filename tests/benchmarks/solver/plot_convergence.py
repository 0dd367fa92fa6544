"""Error against mesh size, one panel a test, ours beside others'."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from femupdate.arrays import Floats
from femupdate.errors import ReportError
from femupdate.report.figure import (
    FAINT,
    INK,
    QUIET,
    SERIES,
    add_head,
    label_edges,
    new_figure,
    styled,
)

_COLUMNS = 4
_SMALLEST = 2e-4  # errors below are as good as none and drawn there
_MARKERS = ("o", "s", "^", "D", "v", "P")


@dataclass(frozen=True)
class ConvergencePanel:
    """One test."""

    title: str  # of the panel
    divisions: Floats  # (n,) elements along a side, ascending
    # Relative errors (n,) by the name of the element; nan where there is no figure
    errors: Mapping[str, Floats]


@styled
def convergence_figure(panels: Sequence[ConvergencePanel], ours: str, title: str) -> Figure:
    """Draw the errors of elements over the fineness of the mesh, both on logarithmic scales."""
    if not panels:
        raise ReportError("there is no convergence to draw; give one panel at least")
    names = list(dict.fromkeys(name for panel in panels for name in panel.errors if name != ours))
    looks = {name: (SERIES[(k + 1) % 6], _MARKERS[(k + 1) % 6]) for k, name in enumerate(names)}
    looks[ours] = (SERIES[0], _MARKERS[0])
    rows = -(-len(panels) // _COLUMNS)
    figure = new_figure(11.0, 2.6 * rows + 0.2)
    axes = figure.subplots(rows, _COLUMNS, sharey=True, squeeze=False)
    for panel, place in zip(panels, axes.flat, strict=False):
        _draw(place, panel, looks, ours)
    label_edges(axes, len(panels), "Elements along a side", "Relative error")
    handles = [_handle(name, looks[name], name == ours) for name in (ours, *names)]
    handles.append(Line2D([], [], color=QUIET, linestyle=":", label="falls with h²"))
    add_head(figure, title, handles)
    return figure


def _draw(
    place: Axes, panel: ConvergencePanel, looks: Mapping[str, tuple[str, str]], ours: str
) -> None:
    divisions = np.asarray(panel.divisions, dtype=np.float64)
    place.axhspan(_SMALLEST, 0.02, color=FAINT, alpha=0.35, linewidth=0.0)
    place.set(xscale="log", yscale="log", ylim=(0.75 * _SMALLEST, 1.5))
    place.set_title(panel.title)
    for name in sorted(panel.errors, key=lambda name: name == ours):
        errors = np.maximum(panel.errors[name], _SMALLEST)
        colour, marker = looks[name]
        heavy = name == ours
        place.plot(
            divisions,
            errors,
            color=colour,
            marker=marker,
            markersize=6.0 if heavy else 4.5,
            linewidth=2.2 if heavy else 1.1,
            zorder=3.0 if heavy else 2.0,
        )
    place.plot(divisions, 0.7 * (divisions[0] / divisions) ** 2, ":", color=QUIET, linewidth=1.0)
    place.xaxis.set_major_locator(FixedLocator(divisions.tolist()))
    place.xaxis.set_minor_locator(NullLocator())
    place.set_xticklabels([f"{value:g}" for value in divisions], color=INK)


def _handle(name: str, look: tuple[str, str], heavy: bool) -> Line2D:
    colour, marker = look
    return Line2D([], [], color=colour, marker=marker, linewidth=2.2 if heavy else 1.1, label=name)
