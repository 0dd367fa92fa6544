"""How every figure looks: one calm style with colours that colour-blind readers can tell apart."""

import functools
from collections.abc import Callable
from types import MappingProxyType
from typing import Any, Literal, ParamSpec, TypeVar

from matplotlib import rc_context

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

MAGNITUDE_MAP = "viridis"
SPREAD_MAP = "cividis"

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
