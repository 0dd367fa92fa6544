"""Poles of a record at every model order, over its spectra, and the shapes of its modes."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from femupdate.measurement.ambient import AmbientModes
from femupdate.report.figure import add_head, new_figure
from femupdate.report.scale import with_unit
from femupdate.report.style import FAINT, QUIET, hue, look, styled


@styled
def stabilisation(found: AmbientModes, title: str) -> Figure:
    """Draw poles by frequency and model order over the spectra, and the shapes beside them."""
    figure = new_figure(12.0, 5.2)
    poles, shapes = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
    behind = poles.twinx()
    low, high = found.band_hz
    inside = (found.frequency_hz >= low) & (found.frequency_hz <= high)
    power = found.spectra.mean(axis=0)[inside]
    behind.fill_between(found.frequency_hz[inside], power, color=FAINT, lw=0)
    behind.set_yscale("log")
    behind.set_yticks([])
    behind.minorticks_off()
    behind.grid(visible=False)
    behind.set_zorder(-1)

    frequency = np.array([pole.frequency_hz for pole in found.poles])
    order = np.array([pole.order for pole in found.poles])
    rest = found.group < 0
    poles.plot(frequency[rest], order[rest], ".", color=QUIET, ms=3)
    handles = []
    for k, mode in enumerate(found.modes):
        mean, sd, group = mode.frequency_hz, mode.frequency_sd_hz or 0.0, found.group == k
        poles.axvspan(mean - 2.0 * sd, mean + 2.0 * sd, color=hue(k), alpha=0.3, lw=0)
        poles.plot(frequency[group], order[group], "o", color=hue(k), ms=4)
        shapes.plot(np.real(mode.shape), range(len(found.channels)), marker="o", ms=3, **look(k))
        # Its deviation may be covered by the dots of the poles.
        label = with_unit(mean, sd, "Hz")
        handles.append(Line2D([], [], marker="o", label=label, **look(k)))
    poles.set(xlabel="Frequency, Hz", ylabel="Model order", xlim=found.band_hz)
    poles.set_title("Poles, with ±2 standard deviations of each mode")
    poles.patch.set_visible(False)
    shapes.set(xlim=(-1.1, 1.1), xticks=(-1.0, 0.0, 1.0), title="Shapes")
    shapes.set_yticks(range(len(found.channels)), found.channels)
    shapes.set_xlabel("Shape over its largest component")
    handles.append(Line2D([], [], color=QUIET, marker=".", linestyle="", label="poles left out"))
    note = "Behind: spectra, the mean over the channels, on a logarithmic scale of their own"
    add_head(figure, title, handles, note=note, columns=5)
    return figure
