"""Trainings side by side: loss and error against processor time."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from femupdate.arrays import Floats
from femupdate.errors import ReportError
from femupdate.report.figure import add_head, checked, new_figure
from femupdate.report.style import QUIET, SERIES, styled


@dataclass(frozen=True)
class RaceCurve:
    """One training.

    Attributes:
        name: of it.
        seconds: (n,) processor time at which it was looked at, ascending.
        gap: (n,) loss above that of a perfect emulator, nats.
        error: (n,) rms error in ln|H|.
    """

    name: str
    seconds: Floats
    gap: Floats
    error: Floats


@styled
def race_figure(curves: Sequence[RaceCurve], level: float) -> Figure:
    """Draw the trainings, all scales logarithmic.

    Args:
        curves: one a training.
        level: a gap at which times are compared, drawn as a line.

    Raises:
        ReportError: there is no curve, or an array has another length.
    """
    if not curves:
        raise ReportError("there is no training to draw; give one curve at least")
    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    for colour, curve in zip(reversed(SERIES[: len(curves)]), curves, strict=True):
        seconds = checked("seconds", curve.seconds, None)
        _draw(left, seconds, checked("gap", curve.gap, len(seconds)), colour)
        _draw(right, seconds, checked("error", curve.error, len(seconds)), colour)
        _mark(left, curve, level, colour)
    left.axhline(level, color=QUIET, linestyle="--", linewidth=1.0)
    left.set(xlabel="Processor time, s", ylabel="Loss above its limit, nats a sample")
    right.set(xlabel="Processor time, s", ylabel="rms error of ln|H|")
    handles = [
        Line2D([], [], color=colour, marker="o", markersize=3.5, label=curve.name)
        for colour, curve in zip(reversed(SERIES[: len(curves)]), curves, strict=True)
    ]
    note = "Held-out roof FRFs from their parameters; dashed: where the times are compared"
    add_head(figure, "Training, four-story building", handles, note=note)
    return figure


def _draw(place: Axes, seconds: Floats, values: Floats, colour: str) -> None:
    place.plot(seconds, values, color=colour, marker="o", markersize=3.0)
    place.set(xscale="log", yscale="log")


def _mark(place: Axes, curve: RaceCurve, level: float, colour: str) -> None:
    """The first point on or under the level, with its time."""
    under = curve.gap <= level
    if not under.any():
        return
    first = int(under.argmax())
    place.plot(
        curve.seconds[first], curve.gap[first], "o", color=colour, markersize=9, fillstyle="none"
    )
    place.annotate(
        f"{curve.seconds[first]:.3g} s",
        (curve.seconds[first], curve.gap[first]),
        xytext=(-6, -12),
        textcoords="offset points",
        ha="right",
        color=colour,
    )
