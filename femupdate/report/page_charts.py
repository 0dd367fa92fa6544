"""Plotly figures of the page, as plain mappings: no plotting library is imported to make them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.report.curves import LEFT_OUT, MEASURED, Curve, Interval
from femupdate.report.style import BLUE, FAINT, INK, ORANGE, QUIET, hue

Figure = Mapping[str, Any]

POINTS = 1600  # of a curve on the screen
_LOG_TICKS = [float(f"{first}e{power}") for power in range(-4, 4) for first in (1, 2, 5)]
_MEASURED = "#9AA3B0"
_BAND = "rgba(0,114,178,0.25)"
_OUTER = "rgba(230,159,0,0.28)"


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis: title with unit, logarithmic or not, and its range."""

    title: str
    log: bool = False
    limits: tuple[float, float] | None = None
    names: tuple[str, ...] = field(default=())


def curve_figure(
    curve: Curve,
    *,
    log: str = "",
    limits: tuple[float, float] | None = None,
    heights: tuple[float, float] | None = None,
) -> Figure:
    """A mean line over its bands, under measured points.

    Args:
        log: "x" and "y", whichever is logarithmic.
        limits, heights: of the axes across and up.
    """
    traces: list[dict[str, Any]] = []
    quiet = {"line": {"width": 0.0}, "hoverinfo": "skip"}
    for number, band in enumerate(curve.bands, 1):
        filled = {"fill": "tonexty", "fillcolor": _OUTER if number < len(curve.bands) else _BAND}
        traces.append(_line(curve.x, band.low, f"{band.name}, low", **quiet, showlegend=False))
        traces.append(_line(curve.x, band.high, band.name, **quiet, **filled))
    used, unused = curve.seen(used=True), curve.seen(used=False)
    if unused is not None:
        traces.append(_points(curve.x, unused, LEFT_OUT, FAINT))
    if used is not None and curve.noise is None:
        wide = {"color": _MEASURED, "width": 3.2}
        traces.append(_line(curve.x, used, MEASURED, line=wide))
    elif used is not None and curve.noise is not None:
        traces.append(_points(curve.x, used, MEASURED, _MEASURED, used * curve.noise))
    traces.append(_line(curve.x, curve.mean, curve.name, line={"color": BLUE, "width": 1.6}))
    across = Axis(title=curve.across, log="x" in log, limits=limits)
    up = Axis(title=curve.up, log="y" in log, limits=heights)
    return {"data": traces, "layout": layout(across, up)}


def _line(x: Floats, y: Floats, name: str, **more: Any) -> dict[str, Any]:
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, **more}


def _markers(x: Floats, y: Floats, name: str, **more: Any) -> dict[str, Any]:
    return {"type": "scatter", "mode": "markers", "x": x, "y": y, "name": name, **more}


def _points(
    x: Floats, y: Floats, name: str, color: str, sd: Floats | None = None
) -> dict[str, Any]:
    shown = np.isfinite(y)
    points = _markers(x[shown], y[shown], name, marker={"color": color, "size": 5})
    if sd is not None:
        look = {"color": "rgba(34,38,43,0.25)", "thickness": 0.8, "width": 0}
        points["error_y"] = {"type": "data", "array": sd[shown], **look}
    return points


def interval_figure(
    rows: Sequence[str],
    intervals: Sequence[Interval],
    across: str,
    ranges: tuple[Floats, Floats] | None = None,
) -> Figure:
    """Means and intervals by rows, the first row lowest, over ranges such as those of the prior."""
    places = np.arange(len(rows), dtype=float)
    traces: list[dict[str, Any]] = []
    if ranges is not None:
        low, high = ranges
        said = {"hovertemplate": "%{base:.3g} to %{x:.3g}<extra>prior</extra>"}
        bars = _bars(high - low, places, "prior range", FAINT)
        traces.append({**bars, "base": low, "width": 0.7, **said})
    for number, one in enumerate(intervals):
        shift = 0.22 * ((len(intervals) - 1) / 2 - number)
        # A stroke covers less of a short interval than a dot does.
        color = hue(one.series)
        stroke = {"symbol": "line-ns-open", "size": 13, "line": {"color": color, "width": 2}}
        traces.append(_markers(one.mean, places + shift, one.name, marker=stroke))
        traces[-1]["marker"]["color"] = color
        traces[-1]["error_x"] = {
            "type": "data",
            "symmetric": False,
            "array": one.high - one.mean,
            "arrayminus": one.mean - one.low,
            "color": color,
            "thickness": 2.4,
            "width": 5,
        }
    figure_layout = layout(Axis(title=across), Axis(title="", names=tuple(rows)))
    return {"data": traces, "layout": figure_layout}


def _bars(x: Floats, y: Floats, name: str, color: str | list[str]) -> dict[str, Any]:
    bars = {"type": "bar", "orientation": "h", "marker": {"color": color}}
    return {**bars, "x": x, "y": y, "name": name}


def bar_figure(rows: Sequence[str], values: Floats, across: str) -> Figure:
    """Horizontal bars, the first row on top and in a colour of its own."""
    colors = [ORANGE, *[QUIET] * (len(rows) - 1)]
    trace = {
        **_bars(values, np.arange(len(rows), dtype=float), across, colors),
        "showlegend": False,
    }
    figure_layout = layout(Axis(title=across), Axis(title="", names=tuple(rows)))
    figure_layout["yaxis"]["autorange"] = "reversed"
    return {"data": [trace], "layout": figure_layout}


def correlation_figure(names: Sequence[str], values: Floats) -> Figure:
    """A matrix of correlations with its figures."""
    trace = {
        "type": "heatmap",
        "z": values,
        "x": [escaped(name) for name in names],
        "y": [escaped(name) for name in names],
        "zmin": -1,
        "zmax": 1,
        "colorscale": [[0, "#0072B2"], [0.5, "#FFFFFF"], [1, "#D55E00"]],
        "texttemplate": "%{z:.2f}",
        "name": "correlation",
        "colorbar": {"thickness": 12},
    }
    made = layout(Axis(title=""), Axis(title=""))
    made["xaxis"]["type"] = made["yaxis"]["type"] = "category"
    made["yaxis"]["autorange"] = "reversed"
    return {"data": [trace], "layout": made}


def pairs_figure(names: Sequence[str], draws: Floats) -> Figure:
    """Draws (n, p) of every pair of parameters, in the lower triangle of a matrix of panels."""
    count = len(names)
    traces, made = [], layout(Axis(title=""), Axis(title=""))
    del made["xaxis"], made["yaxis"]
    number = 0
    for row in range(1, count):
        for column in range(row):
            number += 1
            key = "" if number == 1 else str(number)
            over = escaped(f"{names[row]} over {names[column]}")
            look = {"color": BLUE, "size": 2.5, "opacity": 0.45}
            points = _markers(draws[:, column], draws[:, row], over, marker=look, showlegend=False)
            traces.append({**points, "xaxis": f"x{key}", "yaxis": f"y{key}"})
            side = 1.0 / (count - 1)
            span = (column * side + 0.03, (column + 1) * side - 0.01)
            rise = (1.0 - row * side + 0.03, 1.0 - (row - 1) * side - 0.01)
            inner = {"ticks": "", "zeroline": False, "nticks": 3, "gridcolor": "#EEF0F3"}
            made[f"xaxis{key}"] = {
                **inner,
                "domain": list(span),
                "anchor": f"y{key}",
                "showticklabels": row == count - 1,
                "title": {"text": escaped(names[column]) if row == count - 1 else ""},
            }
            made[f"yaxis{key}"] = {
                **inner,
                "domain": list(rise),
                "anchor": f"x{key}",
                "showticklabels": column == 0,
                "title": {"text": escaped(names[row]) if column == 0 else ""},
            }
    made["hovermode"] = "closest"
    return {"data": traces, "layout": made}


def layout(across: Axis, up: Axis) -> dict[str, Any]:
    """How every chart looks."""
    return {
        "margin": {"l": 64, "r": 16, "t": 8, "b": 44},
        "font": {"family": "system-ui, DejaVu Sans, sans-serif", "size": 12, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hovermode": "closest",
        "hoverlabel": {"namelength": -1},
        "modebar": {"bgcolor": "rgba(255,255,255,0.8)", "color": QUIET},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0},
        "xaxis": _axis(across),
        "yaxis": _axis(up),
    }


def _axis(axis: Axis) -> dict[str, Any]:
    made: dict[str, Any] = {
        "title": {"text": escaped(axis.title), "standoff": 8},
        "gridcolor": "#EEF0F3",
        "zeroline": False,
        "automargin": True,
        "linecolor": QUIET,
    }
    if axis.log:
        made |= {"type": "log", "tickvals": _LOG_TICKS, "ticktext": [f"{v:g}" for v in _LOG_TICKS]}
    if axis.limits is not None:
        low, high = axis.limits
        made["range"] = [float(np.log10(low)), float(np.log10(high))] if axis.log else [low, high]
    if axis.names:
        made["tickvals"] = list(range(len(axis.names)))
        made["ticktext"] = [escaped(name) for name in axis.names]
    return made


def escaped(text: str) -> str:
    """A text that Plotly shows as it is: it reads some HTML elements in titles and labels."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def thinned(values: Floats, most: int = POINTS) -> Integers:
    """Which of the points (n,) to show, at most about `most`: the least and largest of each bin.

    So every peak stays, of the largest value in magnitude too.
    """
    if len(values) <= most:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), most // 2 + 1).astype(np.int64)
    kept = [
        (start + int(part.argmin()), start + int(part.argmax()))
        for start, end in pairwise(edges)
        if len(part := values[start:end])
    ]
    return np.unique([0, *np.ravel(kept), len(values) - 1])
