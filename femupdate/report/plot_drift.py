"""Story shear against story drift."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from femupdate.arrays import Floats
from femupdate.errors import ReportError
from femupdate.report.figure import add_head, panel_grid
from femupdate.report.plot_curves import strongest, symmetric_limits
from femupdate.report.scale import Scale, force_scale, interval_text, length_scale
from femupdate.report.style import BLUE, INK, styled

LINES = 100  # samples drawn
POINTS = 1200  # instants drawn of each


@styled
def story_shear_drift(
    shear: Floats,
    drift: Floats,
    stiffness: Floats,
    stories: Sequence[str],
) -> Figure:
    """Draw shear against drift of every story, the top story first, with its mean stiffness.

    Up to 100 samples are drawn, each in the stretch of the record in which it drifts most.

    Args:
        shear: (S, s, n) N.
        drift: (S, s, n) m.
        stiffness: (S', s) N/m of all samples: mean slope and 5 to 95 % interval.
        stories: s names, the lowest first.

    Raises:
        ReportError: there is no sample.
    """
    if not len(shear) or not len(stiffness):
        raise ReportError("shear and stiffness hold no sample; give one at least")
    count, part = len(stories), _most_drift(drift)
    forces, drifts = shear[:LINES, :, part], drift[:LINES, :, part]
    force, length = force_scale(forces), length_scale(drifts)
    columns = min(count, 2 if count <= 4 else 3)
    across, up = f"Drift, {length.unit}", f"Shear, {force.unit}"
    figure, panels = panel_grid(count, columns, (3.6, 2.75), across, up)
    for panel, story in zip(panels, reversed(range(count)), strict=True):
        lines = np.stack([drifts[:, story] / length.factor, forces[:, story] / force.factor], -1)
        _draw_story(panel, lines, stiffness[:, story], force, length)
        panel.set_title(f"Story {stories[story]}")
    panels[0].set_ylim(symmetric_limits(forces / force.factor))
    panels[0].set_xlim(symmetric_limits(drifts / length.factor))
    panels[0].xaxis.set_major_locator(MaxNLocator(5))
    shown = "1 posterior sample" if len(forces) == 1 else f"{len(forces)} posterior samples"
    mean = Line2D([], [], color=INK, linestyle="--", label="Mean stiffness [5, 95 %]")
    add_head(
        figure, "Story shear against story drift", [Line2D([], [], color=BLUE, label=shown), mean]
    )
    return figure


def _most_drift(drift: Floats) -> slice:
    """The stretch of POINTS instants with most drift, summed over stories each by its size."""
    power = np.einsum("ksn,ksn->sn", drift, drift)
    power /= np.maximum(power.max(axis=1, keepdims=True), 1e-300)
    return strongest(power.sum(axis=0), POINTS)


def _draw_story(panel: Axes, lines: Floats, stiffness: Floats, force: Scale, length: Scale) -> None:
    """Lines (S, n, 2) of drift and shear as shown, and the mean slope across the panel."""
    alpha = min(0.6, 6.0 / len(lines) + 0.06)
    panel.add_collection(LineCollection(list(lines), colors=BLUE, linewidths=0.5, alpha=alpha))
    shown = stiffness * length.factor / force.factor
    panel.axline((0.0, 0.0), slope=shown.mean(), color=INK, linewidth=1.1, linestyle="--")
    low, high = np.quantile(shown, [0.05, 0.95])
    unit = f"{force.unit}/{length.unit}"
    text = interval_text(shown.mean(), shown.std(), low, high).replace(" [", f" {unit}\n[")
    look: dict[str, Any] = {"ha": "right", "va": "bottom", "fontsize": 8.5}
    panel.text(0.97, 0.05, text, transform=panel.transAxes, **look)
