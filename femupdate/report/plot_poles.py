"""Poles of a record at every model order, over its spectra, and the shapes of its modes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from femupdate.measurement.ambient import AmbientModes
from femupdate.measurement.recording import RecordedMode
from femupdate.report.figure import add_head, new_figure
from femupdate.report.scale import with_unit
from femupdate.report.style import FAINT, QUIET, hue, look, styled


@styled
def stabilisation(found: AmbientModes, title: str) -> Figure:
    """Draw poles by frequency and model order over the spectra, and the shapes beside them."""
    figure = new_figure(12.0, 5.2)
    poles, shapes = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
    _draw_spectra(poles.twinx(), found)
    _draw_poles(poles, found)
    _draw_shapes(shapes, found)
    handles = [
        Line2D([], [], marker="o", label=_label(mode), **look(k))
        for k, mode in enumerate(found.modes)
    ]
    left_out = Line2D([], [], color=QUIET, marker=".", linestyle="", label="poles left out")
    note = "Behind: spectra, the mean over the channels, on a logarithmic scale of their own"
    add_head(figure, title, [*handles, left_out], note=note, columns=5)
    return figure


def _label(mode: RecordedMode) -> str:
    """Frequency with its deviation, which the dots of the poles may cover."""
    return with_unit(mode.frequency_hz, mode.frequency_sd_hz or 0.0, "Hz")


def _draw_poles(axes: Axes, found: AmbientModes) -> None:
    frequency = np.array([pole.frequency_hz for pole in found.poles])
    order = np.array([pole.order for pole in found.poles])
    rest = found.group < 0
    axes.plot(frequency[rest], order[rest], ".", color=QUIET, ms=3)
    for k, mode in enumerate(found.modes):
        own = found.group == k
        spread = 2.0 * (mode.frequency_sd_hz or 0.0)
        axes.axvspan(
            mode.frequency_hz - spread, mode.frequency_hz + spread, color=hue(k), alpha=0.3, lw=0
        )
        axes.plot(frequency[own], order[own], "o", color=hue(k), ms=4)
    axes.set(
        xlabel="Frequency, Hz",
        ylabel="Model order",
        title="Poles, with ±2 standard deviations of each mode",
        xlim=found.band_hz,
    )
    axes.patch.set_visible(False)


def _draw_spectra(axes: Axes, found: AmbientModes) -> None:
    """Spectra behind the poles: the mean over the channels."""
    low, high = found.band_hz
    inside = (found.frequency_hz >= low) & (found.frequency_hz <= high)
    power = found.spectra.mean(axis=0)[inside]
    axes.fill_between(found.frequency_hz[inside], power, color=FAINT, lw=0)
    axes.set_yscale("log")
    axes.set_yticks([])
    axes.minorticks_off()
    axes.grid(visible=False)
    axes.set_zorder(-1)


def _draw_shapes(axes: Axes, found: AmbientModes) -> None:
    for k, mode in enumerate(found.modes):
        axes.plot(np.real(mode.shape), range(len(found.channels)), marker="o", ms=3, **look(k))
    axes.set(xlim=(-1.1, 1.1), xticks=(-1.0, 0.0, 1.0))
    axes.set_yticks(range(len(found.channels)), found.channels)
    axes.set(xlabel="Shape over its largest component", title="Shapes")
