"""inspect: what is in measured files, in words and as one picture."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate.building.model_draft import model_words
from femupdate.building.shipped import program_of
from femupdate.errors import BuildingError, MeasurementError
from femupdate.measurement.inspection import Inspection, inspect_file
from femupdate.measurement.write import write_mapping
from femupdate.result import Item, Note, Notes, Result
from femupdate.tables import Table


@dataclass(frozen=True)
class InspectedFiles(Result):
    """What is in some measured files.

    Attributes:
        files: those that could be read.
        refused: a sentence on each of the others.
        models: what is in other programs' models among them.
    """

    files: tuple[Inspection, ...]
    refused: tuple[str, ...] = ()
    models: tuple[tuple[Path, tuple[str, ...]], ...] = ()

    def items(self) -> Iterator[Item]:
        """Every file in words, then the command to run next on it."""
        files = [file.as_dict() for file in self.files]
        models = [
            {"path": path, "program": program_of(path), "notes": notes}
            for path, notes in self.models
        ]
        more = {"decks": models} if models else {}
        yield Note(content={"files": files, "refused": self.refused} | more)
        for path, notes in self.models:
            yield Note(f"{path}: a model of {program_of(path)}")
            yield Notes(notes)
            yield Note(f"Next: femupdate build-model {path}")
        head = ("channel", "direction", "quantity", "rate", "samples", "length", "peak")
        for file in self.files:
            yield Note(f"{file.path}: {file.summary}")
            rows = [
                (
                    f"{each.number} {each.place}",
                    each.direction_text,
                    each.channel.quantity,
                    f"{1.0 / each.channel.time_step:g} Hz",
                    str(each.channel.values.size),
                    f"{each.duration_s:.4g} s",
                    each.peak_text,
                )
                for each in file.channels
            ]
            if rows:
                yield Table.of(head, rows)
            yield from (Note(f"  {text}") for text in (*file.function_texts, *file.mode_texts))
            yield Notes((*file.recording.notes, *file.rotation))
            yield Note("What looks wrong:" if file.all_findings else "Nothing looks wrong.")
            yield Notes(file.all_findings)
            yield Note(f"Next: {file.step.command or file.step.advice}")
            if file.step.command and file.step.advice:
                yield Note(f"  {file.step.advice}")


def inspect_files(
    paths: Sequence[Path], unit: str | None = None, columns: Mapping[str, str] | None = None
) -> InspectedFiles:
    """Return what is in measured files.

    Args:
        paths: of the files; one that cannot be read does not keep the others back.
        unit: of accelerations, or of force and length of a model, where a file does not say it.
        columns: our column name to the file's column or channel, where the user says it.
    """
    files, refused, models = [], [], []
    for path in paths:
        try:
            if program_of(path):
                models.append((path, model_words(path, unit)))
            else:
                files.append(inspect_file(path, unit, columns))
        except (BuildingError, MeasurementError) as error:
            refused.append(str(error))
    return InspectedFiles(tuple(files), tuple(refused), tuple(models))


def propose_mapping(file: Inspection, path: Path, unit: str | None = None) -> Path:
    """Write which channels of a file are which floors, as far as it tells."""
    channels = [each.channel for each in file.channels]
    if not channels:
        raise MeasurementError(f"{file.path}: there are no channels to map to floors")
    return write_mapping(path, file.path, file.step.columns, channels, unit)


def draw_inspection(file: Inspection, path: Path) -> Path:
    """Draw the histories of a file, else its functions of frequency, else its modes."""
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_measured import inspected

    return save_figure(inspected(file), path)
