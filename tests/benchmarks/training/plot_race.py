"""Trainings side by side: loss and error against processor time."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from femupdate.errors import ReportError
from femupdate.report.figure import add_head, new_figure
from femupdate.report.style import QUIET, SERIES, styled

from .race import Point, first_to


@styled
def race_figure(curves: Mapping[str, Sequence[Point]], limit: float, loss: float) -> Figure:
    """Draw the trainings, all scales logarithmic.

    Args:
        curves: points of each training by its name, of which the first is not drawn.
        limit: loss of a perfect emulator.
        loss: at which times are compared, drawn as a line.

    Raises:
        ReportError: there is no curve.
    """
    if not curves:
        raise ReportError("there is no training to draw; give one curve at least")
    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    handles = []
    for colour, (name, looks) in zip(reversed(SERIES[: len(curves)]), curves.items(), strict=True):
        points = looks[1:]
        seconds = [point.cpu_seconds for point in points]
        for axes, values in (
            (left, [point.loss - limit for point in points]),
            (right, [point.rms for point in points]),
        ):
            axes.plot(seconds, values, color=colour, marker="o", markersize=3.0)
        _mark(left, first_to(points, loss), limit, colour)
        handles.append(Line2D([], [], color=colour, marker="o", markersize=3.5, label=name))
    for axes, label in (
        (left, "Loss above its limit, nats a sample"),
        (right, "rms error of ln|H|"),
    ):
        axes.set(xscale="log", yscale="log", xlabel="Processor time, s", ylabel=label)
    left.axhline(loss - limit, color=QUIET, linestyle="--", linewidth=1.0)
    note = "Held-out roof FRFs from their parameters; dashed: where the times are compared"
    add_head(figure, "Training, four-story building", handles, note=note)
    return figure


def _mark(axes: Axes, point: Point | None, limit: float, colour: str) -> None:
    """The first point on or under the line, with its time."""
    if point is None:
        return
    at = (point.cpu_seconds, point.loss - limit)
    axes.plot(*at, "o", color=colour, markersize=9, fillstyle="none")
    axes.annotate(
        f"{point.cpu_seconds:.3g} s",
        at,
        xytext=(-6, -12),
        textcoords="offset points",
        ha="right",
        color=colour,
    )
