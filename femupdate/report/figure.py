"""How every figure looks, in colours that colour-blind readers can tell apart; saving figures."""

import functools
import textwrap
from collections.abc import Callable, Iterable, Sequence
from math import ceil
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, ParamSpec, TypeVar

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import NullLocator
from numpy.typing import ArrayLike, NDArray

from femupdate.arrays import Pixels
from femupdate.errors import ReportError
from femupdate.progress import SILENT, Progress
from femupdate.result import Picture, Result
from femupdate.storage import atomic_path

P = ParamSpec("P")
R = TypeVar("R")

# Okabe and Ito (2008): eight colours that stay apart for the common kinds of colour blindness.
BLUE = "#0072B2"
ORANGE = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
AMBER = "#E69F00"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY)
# Beside the colours, so that series stay apart in grey print. What is known is dotted.
Dashes = Literal["-"] | tuple[float, tuple[float, ...]]
DASHES: tuple[Dashes, ...] = (
    "-",
    (0.0, (4.5, 1.4)),
    (0.0, (7.0, 1.4, 1.4, 1.4)),
    (0.0, (2.2, 1.2)),
    (0.0, (7.0, 1.4, 1.4, 1.4, 1.4, 1.4)),
    (0.0, (10.0, 2.5)),
)
INK = "#22262B"  # text and measured data
QUIET = "#6B7280"  # axes and what stands behind
FAINT = "#D9DDE3"  # grids and priors
PALE = "#A9AFBA"  # measured data below a prediction

# True values, where they are known.
KNOWN: dict[str, Any] = {"color": INK, "linestyle": ":", "linewidth": 1.3}

# Of a prediction: two standard deviations either way, or an interval.
BAND: dict[str, Any] = {"color": BLUE, "alpha": 0.28, "linewidth": 0.0}

# Wide and pale below the prediction: it shows on both sides of a line that fits well.
MEASURED: dict[str, Any] = {"color": PALE, "linewidth": 2.6, "zorder": 1.8}

STYLE = MappingProxyType(
    {
        "axes.axisbelow": True,
        "axes.edgecolor": QUIET,
        "axes.grid": True,
        "axes.labelcolor": INK,
        "axes.labelsize": 10.0,
        "axes.linewidth": 0.8,
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlelocation": "left",
        "axes.titlepad": 5.0,
        "axes.titlesize": 10.0,
        "axes.titleweight": "bold",
        "figure.facecolor": "white",
        "font.family": "DejaVu Sans",  # comes with matplotlib: the same everywhere
        "font.size": 9.5,
        "grid.color": FAINT,
        "grid.linewidth": 0.6,
        "legend.fontsize": 9.5,
        "legend.frameon": False,
        "legend.handlelength": 1.8,
        "lines.linewidth": 1.3,
        "lines.solid_capstyle": "round",
        "savefig.facecolor": "white",
        "text.color": INK,
        "xtick.color": QUIET,
        "xtick.labelcolor": INK,
        "xtick.labelsize": 9.0,
        "ytick.color": QUIET,
        "ytick.labelcolor": INK,
        "ytick.labelsize": 9.0,
    }
)


def hue(number: int) -> str:
    """Colour of the series of a number, counted from 0; they come again after the last."""
    return SERIES[number % len(SERIES)]


def look(number: int) -> dict[str, Any]:
    """Colour and dashes of the series of a number, which stay apart in grey print."""
    return {"color": hue(number), "linestyle": DASHES[number % len(DASHES)]}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Run a drawing function in this style and leave matplotlib's settings as they were."""

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        settings: Any = dict(STYLE)
        with rc_context(settings):
            return draw(*args, **kwargs)

    return wrapper


DOTS_PER_INCH = 150

_TITLE_WIDTH, _NOTE_WIDTH = 0.116, 0.075  # inches of a character, in the mean
MARGIN = 12  # white pixels left around a rendered picture


@styled
def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure in the house style, inches, that pyplot knows nothing of."""
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    _layout(figure).set(w_pad=0.08, h_pad=0.06)
    return figure


def panel_grid(
    count: int, columns: int, size: tuple[float, float], across: str, up: str
) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels that share their axes, and its panels row by row.

    Args:
        size: width and height of a panel, inches.
        across, up: labels of the two axes, with their units.
    """
    rows = ceil(count / columns)
    figure = new_figure(size[0] * columns + 0.5, size[1] * rows + 0.5)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    label_edges(axes, count, across, up)
    return figure, list(axes.flat[:count])


def frequency_ticks(panel: Axes, low: float, high: float, most: int = 8) -> None:
    """Make the axis across logarithmic, with plain figures for ticks, Hz.

    Of 1, 2 and 5 at most so many; powers of ten alone where they would be more.
    """
    panel.set_xscale("log")
    ticks = [m * 10.0**k for k in range(-3, 5) for m in (1, 2, 5)]
    ticks = [tick for tick in ticks if low <= tick <= high]
    if len(ticks) > most:
        ticks = [tick for tick in ticks if f"{tick:e}".startswith("1.0000")]
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.xaxis.set_minor_locator(NullLocator())
    panel.set_xlim(low, high)


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
    handles: Sequence[Any] | None = None,
    *,
    note: str = "",
    columns: int | None = None,
) -> None:
    """Make the figure higher by a title, a note and a legend, which so cover no data.

    Args:
        figure: with all its panels drawn.
        handles: of the legend, with their labels; default everything drawn that has a label.
        note: quiet lines under the title that say how to read the figure.
        columns: of the legend; default all on one line.
    """
    handles = labelled(figure.axes) if handles is None else handles
    title = _wrapped(title, figure.get_figwidth(), _TITLE_WIDTH)
    note = _wrapped(note, figure.get_figwidth(), _NOTE_WIDTH)
    columns = columns or max(len(handles), 1)
    # Heights in inches: of a row of the legend, of the note, of the title and its further rows.
    legend = 0.24 * ceil(len(handles) / columns) + (0.06 if handles else 0.0)
    notes = 0.24 * (note.count("\n") + 1) if note else 0.0
    above = (0.40 + 0.22 * title.count("\n") if title else 0.1) + notes
    head = above + legend
    height = figure.get_figheight() + head
    figure.set_figheight(height)
    _layout(figure).set(rect=(0.0, 0.0, 1.0, 1.0 - head / height))
    left = 0.1 / figure.get_figwidth()
    if title:
        figure.text(left, 1.0 - 0.1 / height, title, fontsize=13.0, fontweight="bold", va="top")
    if note:
        place = 1.0 - (above - notes) / height
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


def _wrapped(text: str, width: float, of_character: float) -> str:
    """Lines that a figure of this width (inches) holds, for characters of a mean width."""
    longest = max(int((width - 0.2) / of_character), 10)
    return "\n".join(textwrap.fill(line, longest) for line in text.split("\n"))


def thin_band_note(share: float, which: str = "The bands") -> str:
    """What to say of bands that are nearly all thinner than this share of the axis, if anything."""
    if share > 0.015:
        return ""
    return (
        f"{which} are up to {100.0 * share:.2g} % of the axis wide nearly everywhere: thinner "
        "than the lines"
    )


def nearly_all(values: ArrayLike) -> float:
    """What 95 % of some widths do not exceed."""
    return float(np.nanquantile(np.asarray(values, dtype=np.float64), 0.95))


def labelled(panels: Iterable[Axes]) -> list[Any]:
    """What is drawn with a label, each label once."""
    found: dict[str, Any] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return list(found.values())


def _layout(figure: Figure) -> ConstrainedLayoutEngine:
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)  # for the type checker: new_figure set it
    return engine


def show(panels: Sequence[Axes], pictures: Sequence[Pixels]) -> None:
    """Show rendered pictures (h, w, 3) without their white margins, all cut to the same window."""
    ink = np.any([picture.min(axis=-1) < 250 for picture in pictures], axis=0)
    rows, columns = (np.flatnonzero(ink.any(axis=axis)) for axis in (1, 0))
    window = tuple(
        slice(max(0, found[0] - MARGIN), found[-1] + MARGIN) if len(found) else slice(None)
        for found in (rows, columns)
    )
    for panel, picture in zip(panels, pictures, strict=True):
        panel.imshow(picture[window], interpolation="lanczos")


@styled
def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG, whole or not at all.

    Raises:
        ReportError: the name does not end in .png, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise ReportError(f"{target} is not the name of a picture; let it end in .png")
    if figure.axes:  # Matplotlib draws all of a figure to lay it out, and then again
        _layout(figure).execute(figure)
        figure.set_layout_engine(None)
    with atomic_path(target, ReportError) as temporary:
        # Packed for 6 s the pictures of a demo would be a tenth smaller than for a third of that.
        packed = {"compress_level": 3}
        figure.savefig(temporary, format="png", dpi=DOTS_PER_INCH, pil_kwargs=packed)
    return target


def draw(result: Result, folder: Path, progress: Progress = SILENT) -> tuple[Path, ...]:
    """Draw every picture of a result into a folder.

    Raises:
        ReportError: one cannot be written.
    """
    return save_pictures(list(result.figures()), folder, progress)


def save_pictures(
    pictures: Sequence[Picture], folder: Path, progress: Progress = SILENT, label: str = "Drawing"
) -> tuple[Path, ...]:
    """Draw pictures into a folder.

    Raises:
        ReportError: one cannot be written.
    """
    progress.start(label, len(pictures))
    paths = []
    for picture in pictures:
        paths.append(save_figure(picture.figure(), folder / f"{picture.name}.png"))
        progress.advance()
    return tuple(paths)
