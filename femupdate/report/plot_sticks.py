"""Mode shapes of lumped buildings: a stick, a point at every floor."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.report.figure import (
    BAND,
    BLUE,
    QUIET,
    add_head,
    nearly_all,
    new_figure,
    styled,
    thin_band_note,
)


@styled
def stick_mode_shapes(
    levels: Floats,
    shapes: Floats,
    headings: Sequence[str],
    floors: Sequence[str],
    *,
    shapes_sd: Floats | None = None,
    title: str = "Mode shapes",
) -> Figure:
    """Draw the modes of a building that is a stick of masses, each with its top to the right.

    Args:
        levels: (f,) heights of the floors, m, the base first.
        shapes: (k, f) mean mode shapes, any scale.
        headings: k texts over the modes: number, frequency, share of the mass.
        floors: f names, the base first.
        shapes_sd: (k, f) standard deviations in the scale of the shapes, or None.
    """
    count, shown = len(shapes), upright(shapes)
    largest = np.maximum(np.abs(shapes).max(axis=1, keepdims=True), 1e-300)
    figure = new_figure(max(1.55 * count + 0.8, 4.6), 4.0)
    axes = figure.subplots(1, count, sharey=True, sharex=True, squeeze=False)[0]
    for mode, panel in enumerate(axes):
        shape, label = shown[mode], "Shape" if shapes_sd is None else "Posterior mean"
        look: dict[str, Any] = {"linewidth": 1.8, "markersize": 6.0, "zorder": 2.2}
        panel.plot(shape, levels, "o-", color=BLUE, label=label, **look)
        if shapes_sd is not None:
            spread = 2.0 * shapes_sd[mode] / largest[mode]
            panel.fill_betweenx(levels, shape - spread, shape + spread, label="± 2 sd", **BAND)
        look = {"linewidth": 0.8, "markersize": 3.0}
        panel.plot(np.zeros_like(levels), levels, "o-", color=QUIET, label="At rest", **look)
        panel.set_title(headings[mode], fontweight="normal")
        panel.spines["left"].set_visible(False)
        panel.tick_params(axis="y", length=0)
        panel.set(xticks=(-1.0, 0.0, 1.0))
    widest = max(1.0, *(abs(bound) for bound in axes[0].get_xlim()))
    axes[0].set_xlim(-1.05 * widest, 1.05 * widest)
    axes[0].set(yticks=levels, yticklabels=floors)
    figure.supxlabel("Displacement over its largest", fontsize=10.0)
    thin = "" if shapes_sd is None else thin_band_note(2.0 * nearly_all(shapes_sd / largest))
    add_head(figure, title, note=thin)
    return figure


def upright(shapes: Floats) -> Floats:
    """Shapes (k, f) over their largest, their tops to the right: the sign of a mode is free."""
    largest = np.maximum(np.abs(shapes).max(axis=1, keepdims=True), 1e-300)
    return np.asarray(np.where(shapes[:, -1:] < 0.0, -1.0, 1.0) * shapes / largest)
