"""inspect: what is in measured files, in words and as one picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femupdate.errors import MeasurementError
from femupdate.measurement.inspection import InspectedChannel, Inspection, inspect_file
from femupdate.measurement.mapping_file import write_mapping
from femupdate.tables import table


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
    from femupdate.report.plot_measured import inspected

    return save_figure(inspected(one), path)


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
