"""Response spectra of floors with their bands."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import ArrayLike

from femupdate.report.figure import checked, new_figure
from femupdate.report.style import BLUE, INK, QUIET, styled

_TICKS = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


@styled
def floor_spectra_bands(
    frequency_hz: ArrayLike,
    mean: ArrayLike,
    sd: ArrayLike,
    floors: Sequence[str],
    *,
    base: ArrayLike,
    title: str = "Floor response spectra",
) -> Figure:
    """Draw the spectrum of every floor over that of the ground motion, the top floor first.

    Args:
        frequency_hz: (k,) of the oscillators, ascending.
        mean, sd: (f, k) over the posterior samples, m/s2; the band is two sd either way.
        floors: f names, bottom to top.
        base: (k,) spectrum of the ground motion, m/s2.
        title: over the figure.

    Raises:
        ReportError: an array has another shape.
    """
    frequency = checked("frequency_hz", frequency_hz, None)
    shape = (len(floors), len(frequency))
    middle, spread = checked("mean", mean, *shape), checked("sd", sd, *shape)
    ground = checked("base", base, len(frequency))
    columns = min(3, len(floors))
    rows = -(-len(floors) // columns)
    figure = new_figure(3.6 * columns + 0.6, 2.5 * rows + 0.9)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for panel in axes.ravel()[len(floors) :]:
        panel.set_visible(False)
    for panel, floor in zip(axes.ravel(), reversed(range(len(floors))), strict=False):
        low, high = middle[floor] - 2 * spread[floor], middle[floor] + 2 * spread[floor]
        panel.fill_between(frequency, low, high, color=BLUE, alpha=0.3, linewidth=0.0)
        panel.plot(frequency, middle[floor], color=BLUE, label="floor")
        panel.plot(frequency, ground, color=QUIET, linestyle="--", label="ground")
        panel.set_xscale("log")
        ticks = [tick for tick in _TICKS if frequency[0] <= tick <= frequency[-1]]
        panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        panel.xaxis.set_minor_locator(NullLocator())
        panel.set_xlim(frequency[0], frequency[-1])
        panel.set_ylim(0.0, 1.08 * float(np.max([middle + 2 * spread, ground + 0 * middle])))
        panel.set_title(floors[floor])
    axes[0, 0].legend(loc="upper left")
    for panel in axes[:, 0]:
        panel.set_ylabel("Acceleration (m/s²)")
    for number in range(columns):
        last = axes[:, number][[axis.get_visible() for axis in axes[:, number]]][-1]
        last.set_xlabel("Oscillator (Hz)")
        last.tick_params(labelbottom=True)
    figure.suptitle(title, x=0.01, ha="left", color=INK, fontweight="bold", fontsize=11)
    return figure
