"""Making and saving figures, and checking what they are made from."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import ArrayLike, NDArray

from femupdate.arrays import Floats
from femupdate.atomic import atomic_path
from femupdate.errors import ReportError
from femupdate.report.style import QUIET, styled

DOTS_PER_INCH = 150


TITLE_HEIGHT = 0.40  # inches
LEGEND_ROW_HEIGHT = 0.24
NOTE_HEIGHT = 0.24


@styled
def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure in the house style, inches, that pyplot knows nothing of."""
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    _layout(figure).set(w_pad=0.08, h_pad=0.06)
    return figure


def label_edges(axes: NDArray[Any], used: int, across: str, up: str) -> None:
    """Label the left column and the lowest used row of a grid of panels; hide unused panels."""
    columns = axes.shape[1]
    for place, panel in enumerate(axes.flat):
        panel.set_visible(place < used)
        if place % columns == 0:
            panel.set_ylabel(up)
        if used - columns <= place < used:
            panel.set_xlabel(across)
            panel.tick_params(labelbottom=True)


@styled
def add_head(
    figure: Figure,
    title: str,
    handles: Sequence[Any] = (),
    *,
    note: str = "",
    columns: int | None = None,
) -> None:
    """Make the figure higher by a title, a note and a legend, which so cover no data.

    Args:
        figure: with all its panels drawn.
        title: in bold, on one line.
        handles: of the legend, with their labels.
        note: one quiet line under the title that says how to read the figure.
        columns: of the legend; default all on one line.
    """
    columns = columns or max(len(handles), 1)
    legend = LEGEND_ROW_HEIGHT * ceil(len(handles) / columns) + (0.06 if handles else 0.0)
    above = (TITLE_HEIGHT if title else 0.1) + (NOTE_HEIGHT if note else 0.0)
    head = above + legend
    height = figure.get_figheight() + head
    figure.set_figheight(height)
    _layout(figure).set(rect=(0.0, 0.0, 1.0, 1.0 - head / height))
    left = 0.1 / figure.get_figwidth()
    if title:
        figure.text(left, 1.0 - 0.1 / height, title, fontsize=13.0, fontweight="bold", va="top")
    if note:
        place = 1.0 - (above - NOTE_HEIGHT) / height
        figure.text(left, place, note, fontsize=9.0, color=QUIET, va="top")
    if handles:
        figure.legend(
            handles=list(handles),
            loc="upper left",
            bbox_to_anchor=(left, 1.0 - above / height),
            ncols=columns,
            borderaxespad=0.0,
            borderpad=0.2,
        )


def _layout(figure: Figure) -> ConstrainedLayoutEngine:
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)  # for the type checker: new_figure set it
    return engine


@styled
def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG, whole or not at all.

    Raises:
        ReportError: the name does not end in .png, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise ReportError(f"{target} is not the name of a picture; let it end in .png")
    with atomic_path(target, ReportError) as temporary:
        figure.savefig(temporary, format="png", dpi=DOTS_PER_INCH)
    return target


def checked(name: str, values: ArrayLike, *shape: int | None) -> Floats:
    """Return values as floats of the shape asked for; None stands for any length.

    Raises:
        ReportError: another shape.
    """
    array = np.asarray(values, dtype=np.float64)
    fits = array.ndim == len(shape) and all(
        wanted is None or wanted == length
        for wanted, length in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise ReportError(f"{name} has the shape {array.shape}; the figure needs ({wanted})")
    return array


def checked_names(name: str, values: Sequence[str], count: int) -> tuple[str, ...]:
    """Return the names, of which there must be `count`.

    Raises:
        ReportError: more or fewer.
    """
    if len(values) != count:
        raise ReportError(f"{name} holds {len(values)} names; the figure needs {count}")
    return tuple(values)
