"""Mode shapes of lumped buildings: a stick, a point at every floor."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.report.figure import add_head, checked, checked_names, new_figure
from femupdate.report.scale import plus_minus
from femupdate.report.style import BAND, BLUE, QUIET, styled


@styled
def stick_mode_shapes(
    levels: ArrayLike,
    shapes: ArrayLike,
    frequency_hz: ArrayLike,
    *,
    shapes_sd: ArrayLike | None = None,
    frequency_sd: ArrayLike | None = None,
    floors: Sequence[str] | None = None,
    numbers: Sequence[int] | None = None,
    title: str = "Mode shapes",
) -> Figure:
    """Draw the modes of a building that is a stick of masses, each with its top to the right.

    Args:
        levels: (f,) heights of the floors, m, the base first.
        shapes: (k, f) mean mode shapes, any scale.
        frequency_hz: (k,) mean natural frequencies.
        shapes_sd: (k, f) standard deviations in the scale of the shapes, or None.
        frequency_sd: (k,) Hz, or None.
        floors: f names, the base first, or None.
        numbers: k numbers of the modes; from 1 where None.

    Raises:
        ReportError: an array has another shape.
    """
    heights = checked("levels", levels, None)
    means = checked("shapes", shapes, None, len(heights))
    count = len(means)
    frequency = checked("frequency_hz", frequency_hz, count)
    spread = None if frequency_sd is None else checked("frequency_sd", frequency_sd, count)
    sds = None if shapes_sd is None else checked("shapes_sd", shapes_sd, *means.shape)
    largest = np.maximum(np.abs(means).max(axis=1, keepdims=True), 1e-300)
    upright = np.where(means[:, -1:] < 0.0, -1.0, 1.0)  # the sign of a mode is free
    shown = means * upright / largest
    figure = new_figure(max(1.55 * count + 0.8, 4.6), 4.0)
    axes = figure.subplots(1, count, sharey=True, sharex=True, squeeze=False)[0]
    for mode, panel in enumerate(axes):
        sd = None if sds is None else sds[mode] / largest[mode]
        _draw_stick(panel, heights, shown[mode], sd, spread is not None)
        value = plus_minus(frequency[mode], 0.0 if spread is None else spread[mode])
        number = mode + 1 if numbers is None else numbers[mode]
        panel.set_title(f"Mode {number}\n{value} Hz", fontweight="normal")
    _finish(axes, heights, floors)
    figure.supxlabel("Displacement over its largest", fontsize=10.0)
    add_head(figure, title)
    return figure


def _draw_stick(
    panel: Axes, heights: Floats, shape: Floats, sd: Floats | None, posterior: bool
) -> None:
    label = "Posterior mean" if posterior else "Shape"
    look: dict[str, Any] = {"linewidth": 1.8, "markersize": 6.0, "zorder": 2.2}
    panel.plot(shape, heights, "o-", color=BLUE, label=label, **look)
    if sd is not None:
        low, high = shape - 2.0 * sd, shape + 2.0 * sd
        panel.fill_betweenx(heights, low, high, label="± 2 sd", **BAND)
    look = {"linewidth": 0.8, "markersize": 3.0}
    panel.plot(np.zeros_like(heights), heights, "o-", color=QUIET, label="At rest", **look)


def _finish(axes: Sequence[Axes], heights: Floats, floors: Sequence[str] | None) -> None:
    for panel in axes:
        panel.spines["left"].set_visible(False)
        panel.tick_params(axis="y", length=0)
        panel.set(xticks=(-1.0, 0.0, 1.0))
    widest = max(1.0, *(abs(bound) for bound in axes[0].get_xlim()))
    axes[0].set_xlim(-1.05 * widest, 1.05 * widest)
    if floors is None:
        axes[0].set_ylabel("Height, m")
    else:
        axes[0].set(yticks=heights, yticklabels=checked_names("floors", floors, len(heights)))
