"""The one picture of what is in a measured file."""

from matplotlib.figure import Figure

from femupdate.errors import ReportError
from femupdate.measurement.columns import BASE
from femupdate.measurement.inspection import InspectedChannel, Inspection
from femupdate.report.plot_measured import (
    MeasuredLine,
    measured_functions,
    measured_histories,
    measured_modes,
)


def inspection_picture(one: Inspection) -> Figure:
    """Draw the histories of a file, else its functions of frequency, else its modes.

    Raises:
        ReportError: the file holds none of them.
    """
    title = one.path.name
    if one.channels:
        known = all(each.peak_m_s2 is not None for each in one.channels)
        lines = [_line(each, one.channels) for each in one.channels]
        units = {each.channel.unit or "the file's unit" for each in one.channels}
        return measured_histories(lines, title, "m/s2" if known else " or ".join(sorted(units)))
    if one.functions:
        curves = [(each.name, each.frequency_hz, each.values) for each in one.functions]
        units = {each.unit or each.kind for each in one.functions}
        return measured_functions(curves, title, " or ".join(sorted(units)))
    if one.recording.modes:
        modes = [(f"{each.frequency_hz:.4g} Hz", each.shape) for each in one.recording.modes]
        return measured_modes(modes, title)
    raise ReportError(f"{one.path}: there is nothing to draw in it but measuring points")


def _line(each: InspectedChannel, channels: tuple[InspectedChannel, ...]) -> MeasuredLine:
    """A channel in m/s2 where its unit is known; floors respond to the first base beside them."""
    factor = 1.0 if each.peak_m_s2 is None or each.peak == 0.0 else each.peak_m_s2 / each.peak
    base = next((c for c in channels if c.floor == BASE and not c.channel.vertical), None)
    alike = base is not None and base.channel.direction == each.channel.direction
    responds = None if each.floor is None or not alike else each is base
    if each.floor == BASE and each is not base:
        responds = None
    return MeasuredLine(
        f"{each.number} {each.place} {each.direction_text}".strip(),
        each.channel.values * factor,
        each.channel.time_step,
        responds,
    )
