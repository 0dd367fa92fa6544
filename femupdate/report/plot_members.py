"""Histories of the forces in members, with their bands."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.report.figure import add_head, checked, nearly_all, new_figure, thin_band_note
from femupdate.report.plot_history import strong_part
from femupdate.report.scale import Scale, force_scale
from femupdate.report.style import BAND, BLUE, styled

MemberHistories = tuple[str, Sequence[str], ArrayLike, ArrayLike]


@styled
def member_force_bands(
    time: ArrayLike,
    members: Sequence[MemberHistories],
    *,
    title: str = "Forces of members",
    note: str = "",
) -> Figure:
    """Draw a row of panels for every member, in the strong part of the motion.

    Args:
        time: (n,) s.
        members: of each its name, the names of its three forces (normal force, shear, moment), and
            their mean and standard deviation (3, n), N and N m; the band is two sd either way.
        note: under the title.

    Raises:
        ReportError: an array has another shape.
    """
    instants = checked("time", time, None)
    start, end = strong_part(instants, checked("mean", members[0][2], 3, len(instants))[1])
    shown = (instants >= start) & (instants <= end)
    scales, shares = _scales(members), []
    figure = new_figure(11.5, 0.5 + 2.0 * len(members))
    axes = figure.subplots(len(members), 3, sharex=True, squeeze=False)
    for row, (name, forces, mean, sd) in zip(axes, members, strict=True):
        middle = checked("mean", mean, 3, len(instants))
        spread = checked("sd", sd, 3, len(instants))
        for panel, force, one, two in zip(row, forces, middle, spread, strict=True):
            scale = scales[force.startswith("M")]
            _draw(panel, instants[shown], one[shown], 2.0 * two[shown], force, scale)
            low, high = panel.get_ylim()
            shares.append(4.0 * two[shown] / scale.factor / (high - low))
        row[0].set_title(name, loc="left")
    for panel in axes[-1]:
        panel.set_xlabel("Time, s")
    thin = thin_band_note(nearly_all(shares))
    add_head(figure, title, note="\n".join(one for one in (note, thin) if one))
    return figure


def _scales(members: Sequence[MemberHistories]) -> tuple[Scale, Scale]:
    """One unit for the forces and one for the moments of all members."""
    largest = [0.0, 0.0]
    for _, forces, mean, sd in members:
        tops = (np.abs(np.asarray(mean)) + 2.0 * np.asarray(sd)).max(axis=1)
        for force, top in zip(forces, tops, strict=True):
            moment = force.startswith("M")
            largest[moment] = max(largest[moment], float(top))
    return force_scale(largest[0]), force_scale(largest[1])


def _draw(panel: Axes, time: Floats, mean: Floats, band: Floats, force: str, scale: Scale) -> None:
    low, high = (mean - band) / scale.factor, (mean + band) / scale.factor
    panel.plot(time, mean / scale.factor, color=BLUE, linewidth=1.0, label="Mean")
    panel.fill_between(time, low, high, label="Mean ± 2 sd", **BAND)
    unit = f"{scale.unit} m" if force.startswith("M") else scale.unit
    panel.set_ylabel(f"{force.replace('_', ' ')}, {unit}")
    panel.set_xlim(time[0], time[-1])
