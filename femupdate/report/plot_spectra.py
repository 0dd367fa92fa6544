"""Response spectra of floors with their bands."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from femupdate.report.figure import add_head, checked, frequency_ticks, panel_grid
from femupdate.report.style import BAND, BLUE, QUIET, styled


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

    Raises:
        ReportError: an array has another shape.
    """
    frequency = checked("frequency_hz", frequency_hz, None)
    shape = (len(floors), len(frequency))
    middle, spread = checked("mean", mean, *shape), checked("sd", sd, *shape)
    ground = checked("base", base, len(frequency))
    size, columns = (3.6, 2.5), min(3, len(floors))
    figure, panels = panel_grid(len(floors), columns, size, "Oscillator, Hz", "Acceleration, m/s²")
    for panel, floor in zip(panels, reversed(range(len(floors))), strict=True):
        low, high = middle[floor] - 2 * spread[floor], middle[floor] + 2 * spread[floor]
        panel.plot(frequency, middle[floor], color=BLUE, label="Floor, mean")
        panel.fill_between(frequency, low, high, label="Mean ± 2 sd", **BAND)
        panel.plot(frequency, ground, color=QUIET, linestyle="--", label="Ground")
        panel.set_title(floors[floor])
    frequency_ticks(panels[0], frequency[0], frequency[-1])
    panels[0].set_ylim(0.0, 1.08 * max((middle + 2 * spread).max(), ground.max()))
    add_head(figure, title)
    return figure
