"""inspect: what is in measured files, in words and as one picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femupdate.errors import MeasurementError, ReportError
from femupdate.measurement.base_rotation import is_vertical_channel
from femupdate.measurement.columns import BASE
from femupdate.measurement.inspection import InspectedChannel, Inspection, inspect_file
from femupdate.measurement.mapping_file import write_mapping
from femupdate.measurement.modes import in_phase
from femupdate.tables import table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from femupdate.report.plot_measured import MeasuredLine


@dataclass(frozen=True)
class InspectedFiles:
    """What is in some measured files.

    Attributes:
        files: those that could be read.
        refused: a sentence on each of the others.
    """

    files: tuple[Inspection, ...]
    refused: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        return {"files": [one.as_dict() for one in self.files], "refused": self.refused}

    def lines(self) -> tuple[str, ...]:
        """Every file in words, then the command to run next on it."""
        return tuple(line for one in self.files for line in _lines(one))


def inspect_files(
    paths: Sequence[Path], unit: str | None = None, columns: Mapping[str, str] | None = None
) -> InspectedFiles:
    """Return what is in measured files.

    Args:
        paths: of the files; one that cannot be read does not keep the others back.
        unit: of accelerations, where a file does not say it.
        columns: our column name to the file's column or channel, where the user says it.
    """
    files, refused = [], []
    for path in paths:
        try:
            files.append(inspect_file(path, unit, columns))
        except MeasurementError as error:
            refused.append(str(error))
    return InspectedFiles(tuple(files), tuple(refused))


def propose_mapping(one: Inspection, path: Path, unit: str | None = None) -> Path:
    """Write which channels of a file are which floors, as far as it tells.

    Raises:
        MeasurementError: the file has no channels, or the mapping cannot be written.
    """
    channels = [each.channel for each in one.channels]
    if not channels:
        raise MeasurementError(f"{one.path}: there are no channels to map to floors")
    return write_mapping(path, one.path, one.step.columns, channels, unit)


def draw_inspection(one: Inspection, path: Path) -> Path:
    """Draw the histories of a file, else its functions of frequency, else its modes.

    Raises:
        ReportError: the file holds none of them, or the picture cannot be written.
    """
    from femupdate.report.figure import save_figure

    return save_figure(_picture(one), path)


def _lines(one: Inspection) -> list[str]:
    found = [f"{one.path}: {one.summary}"]
    if one.channels:
        head = ("channel", "direction", "quantity", "rate", "samples", "length", "peak")
        found.append(table(head, [_row(each) for each in one.channels]))
    found += [f"  {text}" for text in (*one.function_texts, *one.mode_texts)]
    found += [f"  - {note}" for note in (*one.recording.notes, *one.rotation)]
    found.append("What looks wrong:" if one.all_findings else "Nothing looks wrong.")
    found += [f"  - {finding}" for finding in one.all_findings]
    found.append(f"Next: {one.step.command or one.step.advice}")
    if one.step.command and one.step.advice:
        found.append(f"  {one.step.advice}")
    return found


def _row(each: InspectedChannel) -> tuple[str, ...]:
    one = each.channel
    return (
        f"{each.number} {each.place}",
        each.direction_text,
        one.quantity,
        f"{1.0 / one.time_step:g} Hz",
        str(one.values.size),
        f"{each.duration_s:.4g} s",
        each.peak_text,
    )


def _picture(one: Inspection) -> "Figure":
    from femupdate.report import plot_measured as plot

    title = one.path.name
    if one.channels:
        force = next((each for each in one.channels if each.channel.quantity == "force"), None)
        pushed = force is not None and not any(each.floor == BASE for each in one.channels)
        if force is not None and pushed:
            lines = [_line_under(force, each) for each in one.channels]
            responses = {
                _unit(each) for k, each in enumerate(one.channels) if lines[k].base is False
            }
            over = f"{_listed(responses)} per {force.channel.unit}"
        else:
            lines, over = [_line(each, one.channels) for each in one.channels], ""
        units = _listed({_unit(each) for each in one.channels})
        return plot.measured_histories(lines, title, units, over)
    if one.functions:
        curves = [(each.name, each.frequency_hz, each.values) for each in one.functions]
        return plot.measured_functions(
            curves, title, _listed({each.unit or each.kind for each in one.functions})
        )
    if one.modes:
        modes = [
            plot.MeasuredMode(each.frequency_hz, each.damping, in_phase(each.shape), each.sensors)
            for each in one.modes
        ]
        return plot.measured_modes(modes, title)
    raise ReportError(f"{one.path}: there is nothing to draw in it but measuring points")


def _unit(each: InspectedChannel) -> str:
    """Unit in which a channel is drawn."""
    return "m/s²" if each.peak_m_s2 is not None else each.channel.unit or "the file's unit"


def _line_under(force: InspectedChannel, each: InspectedChannel) -> "MeasuredLine":
    """A channel beside a force, to which all but other forces respond."""
    responds = None if each.channel.quantity == "force" else False
    return _drawn(each, True if each is force else responds)


def _line(each: InspectedChannel, channels: Sequence[InspectedChannel]) -> "MeasuredLine":
    """A channel in m/s2 where its unit is known; floors respond to the first base beside them."""
    base = next(
        (c for c in channels if c.floor == BASE and not is_vertical_channel(c.channel)), None
    )
    beside = base is not None and base.channel.direction == each.channel.direction
    responds = each.floor not in (None, BASE) and beside
    return _drawn(each, True if each is base else False if responds else None)


def _drawn(each: InspectedChannel, base: bool | None) -> "MeasuredLine":
    from femupdate.report.plot_measured import MeasuredLine

    factor = 1.0 if each.peak_m_s2 is None or each.peak == 0.0 else each.peak_m_s2 / each.peak
    place, direction = each.place, each.direction_text
    if place.casefold().endswith(direction.casefold()):
        direction = ""
    return MeasuredLine(
        f"{each.number} {place} {direction}".strip(),
        each.channel.values * factor,
        each.channel.time_step,
        base,
    )


def _listed(words: set[str]) -> str:
    return " or ".join(sorted(words))
