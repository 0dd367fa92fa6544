"""What is in a measured file: histories, spectra, response to the base, poles and modes."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from femupdate.arrays import Floats, Integers
from femupdate.errors import ReportError
from femupdate.measurement.ambient import AmbientModes
from femupdate.measurement.inspection import InspectedChannel, Inspection
from femupdate.measurement.modes import in_phase
from femupdate.measurement.names import BASE
from femupdate.measurement.recording import RecordedFunction, RecordedMode
from femupdate.report.figure import (
    FAINT,
    QUIET,
    add_head,
    frequency_ticks,
    hue,
    look,
    new_figure,
    styled,
)
from femupdate.report.scale import with_unit

MOST_LINES = 24
POINTS = 4000  # of a history drawn, as the extremes of short stretches


@styled
def inspected(file: Inspection) -> Figure:
    """Draw the histories of a file, else its functions of frequency, else its modes.

    The first `MOST_LINES` of them are drawn.

    Raises:
        ReportError: the file holds none of them.
    """
    title = file.path.name
    if file.channels:
        return _histories(file.channels, title)
    if file.functions:
        return _functions(file.functions, title)
    if file.modes:
        return _modes(file.modes, title)
    raise ReportError(f"{file.path}: there is nothing to draw in it but measuring points")


def _histories(channels: Sequence[InspectedChannel], title: str) -> Figure:
    """Histories one above the other, their spectra, and the response to the base or a force."""
    drawn = channels[:MOST_LINES]
    driver, responding = _driven(channels)
    # Those that were sampled at the times of what drives them.
    times = [(each.channel.values.size, each.channel.time_step) for each in drawn]
    driven = driver and (driver.channel.values.size, driver.channel.time_step)
    beside = [k for k, each in enumerate(drawn) if each in responding and times[k] == driven]
    compared = driver in drawn and bool(beside)
    figure = new_figure(13.0, 2.6 + 0.3 * len(drawn) + (1.6 if compared else 0.0))
    grid = figure.add_gridspec(2 if compared else 1, 5)
    _draw_histories(figure.add_subplot(grid[:, :3]), drawn)
    _draw_spectra(figure.add_subplot(grid[0, 3:]), drawn, _listed({_unit(c) for c in channels}))
    if driver is not None and compared:
        response, share = figure.add_subplot(grid[1, 3]), figure.add_subplot(grid[1, 4])
        _draw_response(response, share, driver, {k: drawn[k] for k in beside})
        response.set(ylabel="|H|", title="Floor over base")
        if driver.floor != BASE:
            units = _listed({_unit(each) for each in responding})
            response.set(ylabel=f"|H|, {units} per {driver.channel.unit}")
            response.set(title="Response to the force")
    left_out = len(channels) - len(drawn)
    note = f"{left_out} more channels are not drawn." if left_out else ""
    handles = [Line2D([], [], label=_label(each), **look(k)) for k, each in enumerate(drawn)]
    add_head(figure, title, handles, columns=8, note=note)
    return figure


def _functions(functions: Sequence[RecordedFunction], title: str) -> Figure:
    """The size of functions of frequency."""
    figure, drawn = new_figure(9.0, 4.0), functions[:MOST_LINES]
    axes = figure.add_subplot()
    for k, each in enumerate(drawn):
        size = np.abs(each.values)
        # A zero, as a spectrum may have at 0 Hz, is no value to draw to.
        axes.semilogy(each.frequency_hz, np.where(size > 0.0, size, np.nan), **look(k))
    axes.set(
        xlabel="Frequency, Hz",
        ylabel=_listed({function.unit or function.kind for function in functions}),
    )
    handles = [Line2D([], [], label=each.name, **look(k)) for k, each in enumerate(drawn)]
    add_head(figure, title, handles, columns=4)
    return figure


def _modes(modes: Sequence[RecordedMode], title: str) -> Figure:
    """Shapes of identified modes, the real part of their components point by point.

    Of modes without shapes the damping ratios over the frequencies.
    """
    figure, shown = new_figure(9.0, 4.0), modes[:MOST_LINES]
    axes = figure.add_subplot()
    handles = [
        Line2D([], [], label=f"{mode.frequency_hz:.4g} Hz", **look(k))
        for k, mode in enumerate(shown)
    ]
    add_head(figure, title, handles, columns=4)
    if not any(mode.shape.size for mode in shown):
        for k, mode in enumerate(shown):
            ratio = 100.0 * (mode.damping or 0.0)
            axes.plot([mode.frequency_hz] * 2, [0.0, ratio], "o-", ms=5, color=hue(k))
        axes.set(xlabel="Frequency, Hz", ylabel="Damping ratio, %", ylim=(0.0, None))
        axes.set_xlim(0.0, 1.1 * max(mode.frequency_hz for mode in shown))
        return figure
    for k, mode in enumerate(shown):
        values = np.real(in_phase(mode.shape))
        largest = np.nanmax(np.abs(values), initial=1e-300)
        axes.plot(values / largest, marker="o", ms=3, **look(k))
    axes.set(xlabel="Component, point by point", ylabel="Shape over its largest component")
    names = shown[0].sensors
    alike = all(mode.sensors == names for mode in shown)
    if alike and sum(map(len, names)) <= 80:
        axes.set_xticks(range(len(names)), names)
        axes.set_xlabel("")
    return figure


def _driven(
    channels: Sequence[InspectedChannel],
) -> tuple[InspectedChannel | None, list[InspectedChannel]]:
    """What drives the others, the base or else a force, and the channels that respond to it."""
    base = [each for each in channels if each.floor == BASE]
    force = next((each for each in channels if each.channel.quantity == "force"), None)
    if force is not None and not base:
        return force, [each for each in channels if each.channel.quantity != "force"]
    first = next((each for each in base if not each.channel.vertical), None)
    if first is None:
        return None, []
    along = [each for each in channels if each.channel.direction == first.channel.direction]
    return first, [each for each in along if each.floor not in (None, BASE)]


def _values(each: InspectedChannel) -> Floats:
    """(n,) a history, in m/s2 where its unit is known."""
    factor = 1.0 if each.peak_m_s2 is None or each.peak == 0.0 else each.peak_m_s2 / each.peak
    return each.channel.values * factor


def _unit(each: InspectedChannel) -> str:
    """Unit in which a channel is drawn."""
    return "m/s²" if each.peak_m_s2 is not None else each.channel.unit or "the file's unit"


def _label(each: InspectedChannel) -> str:
    place, direction = each.place, each.direction_text
    if place.casefold().endswith(direction.casefold()):
        direction = ""
    return f"{each.number} {place} {direction}".strip()


def _listed(words: set[str]) -> str:
    return " or ".join(sorted(words))


def _draw_histories(axes: Axes, channels: Sequence[InspectedChannel]) -> None:
    # So that neighbours do not overlap, whatever their peaks.
    histories = [_values(each) for each in channels]
    spacing = 2.0 * max(float(np.abs(values - values.mean()).max()) for values in histories)
    spacing = spacing or 1.0
    for k, (each, values) in enumerate(zip(channels, histories, strict=True)):
        kept = thinned(values)
        height = values[kept] - values.mean() - k * spacing
        axes.plot(kept * each.channel.time_step, height, color=hue(k), linewidth=0.6)
    axes.set_yticks([-k * spacing for k in range(len(channels))], [_label(c) for c in channels])
    for k, label in enumerate(axes.get_yticklabels()):
        label.set_color(hue(k))
    axes.set(xlabel="Time, s", title="Histories, to one scale, about their means")
    axes.grid(axis="y", visible=False)


def _draw_spectra(axes: Axes, channels: Sequence[InspectedChannel], unit: str) -> None:
    from scipy.signal import welch

    top = 1e-300
    steps = [each.channel.time_step for each in channels]
    for k, (each, step) in enumerate(zip(channels, steps, strict=True)):
        frequency, power = welch(_values(each), 1.0 / step, nperseg=_segment(each))
        axes.loglog(frequency[1:], np.sqrt(power[1:]) + 1e-300, **look(k), linewidth=0.9)
        top = max(top, float(np.sqrt(power[1:].max(initial=0.0))))
    axes.set_ylim(top * 1e-5, top * 2.0)
    longest = max(step * _segment(each) for each, step in zip(channels, steps, strict=True))
    frequency_ticks(axes, 1.0 / longest, 0.5 / min(steps))
    axes.set(xlabel="Frequency, Hz", ylabel=f"{unit} per √Hz", title="Spectra")


def _draw_response(
    response: Axes, share: Axes, driver: InspectedChannel, floors: Mapping[int, InspectedChannel]
) -> None:
    from scipy.signal import coherence, csd, welch

    options = {"fs": 1.0 / driver.channel.time_step, "nperseg": _segment(driver)}
    input_ = _values(driver)
    frequency, power = welch(input_, **options)
    # Where the input has no power, leakage alone would make a response.
    shown = (frequency > 0.0) & (power > 1e-5 * power.max())
    for k, each in floors.items():
        output = _values(each)
        cross = csd(input_, output, **options)[1]
        size = np.abs(cross[shown]) / power[shown]
        response.loglog(frequency[shown], size + 1e-300, **look(k), linewidth=0.9)
        seen = coherence(input_, output, **options)[1]
        share.semilogx(frequency[shown], seen[shown], **look(k), linewidth=0.9)
    for axes in (response, share):
        frequency_ticks(axes, float(frequency[1]), float(frequency[-1]), 5)
    response.set(xlabel="Frequency, Hz")
    share.set(xlabel="Frequency, Hz", ylim=(0.0, 1.02), title="Coherence")


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


def _segment(each: InspectedChannel) -> int:
    # Sixteen segments of Welch's method, half overlapping.
    return max(2 * each.channel.values.size // 17, 2)


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
