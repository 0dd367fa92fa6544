"""inspect and identify: what is in measured files, in words, pictures and modes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femupdate.building.model_files import model_words
from femupdate.building.shipped import program_of
from femupdate.errors import BuildingError, MeasurementError
from femupdate.measurement.ambient import ORDER, AmbientModes, identify_modes
from femupdate.measurement.inspection import Inspection, inspect_file
from femupdate.measurement.modes import mode_findings
from femupdate.measurement.names import BASE, si_factor
from femupdate.measurement.observation import motions_in
from femupdate.measurement.reader import read_measured
from femupdate.measurement.write import write_modes
from femupdate.report.scale import with_unit
from femupdate.result import Item, Note, Notes, Picture, Result, Told
from femupdate.study import timed
from femupdate.tables import Column, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class InspectedFiles(Result):
    """What is in some measured files.

    Attributes:
        files: those that could be read.
        refused: a sentence on each of the others.
        models: other programs' models among them, what is in each, and the next command.
    """

    files: tuple[Inspection, ...]
    refused: tuple[str, ...] = ()
    models: tuple[tuple[Path, tuple[str, ...], str], ...] = ()

    def items(self) -> Iterator[Item]:
        """Every file in words, then the command to run next on it."""
        files = [file.as_dict() for file in self.files]
        models = [
            {"path": path, "program": program_of(path), "notes": notes, "next": command}
            for path, notes, command in self.models
        ]
        more = {"decks": models} if models else {}
        yield Note(content={"files": files, "refused": self.refused} | more)
        for path, notes, command in self.models:
            yield Note(f"{path}: a model of {program_of(path)}")
            yield Notes(notes)
            yield Note(f"Next: {command}")
        yield Notes(self.refused)
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
            if file.step.command.startswith("femupdate calibrate"):
                yield Note("  In a new study, name the building as well: --building FILE.")


def inspect(
    *files: Path | str,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    rate: float | None = None,
) -> InspectedFiles:
    """What is in measured files and what looks wrong; of several, one that cannot be read is told.

    Args:
        unit: of accelerations, or of force and length of a model, where a file does not say it.
        columns: our column name to the file's column or channel.
        rate: samples a second, of a table without times.

    Raises:
        MeasurementError: none can be read.
    """
    read, refused, models = [], [], []
    for path in map(Path, files):
        try:
            if program_of(path):
                words = model_words(path, unit)
                wanted = unit
                if words[-1].startswith("Units: "):  # those are wrong: does the file tell them?
                    unknown = model_words(path, None)[-1].startswith("Units: ")
                    wanted = "FORCE,LENGTH" if unknown else None
                units = f" --units {wanted}" if wanted else ""
                command = f"femupdate build-model {path}{units} --draft {path.stem}.toml"
                models.append((path, words, command))
            else:
                read.append(inspect_file(path, unit, timed(columns, rate)))
        except (BuildingError, MeasurementError) as error:
            refused.append(str(error))
    if not read and not models:
        raise MeasurementError(". ".join(refused) or "no measured file is named; give one or more")
    return InspectedFiles(tuple(read), tuple(refused), tuple(models))


def draw_inspection(file: Inspection, path: Path) -> Path:
    """Draw the histories of a file, else its functions of frequency, else its modes."""
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_measured import inspected

    return save_figure(inspected(file), path)


def identify(
    record: Path | str,
    output: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    rate: float | None = None,
    band_hz: tuple[float, float] | None = None,
    order: int = ORDER,
) -> Told:
    """Identify modes from floor motions alone (ambient vibration), and write them as a table.

    Args:
        output: CSV file, which `calibrate` reads.
        columns: our column name to the file's column or channel.
        rate: samples a second, of a table without times.
        band_hz: in which modes are looked for; by default about the first peaks of the spectra.
        order: the largest of the models.

    Raises:
        MeasurementError: the file cannot be used, or holds no modes.
    """
    path = Path(record)
    recording = read_measured(path)
    floors = {
        ours: channel
        for ours, channel in motions_in(recording, timed(columns, rate)).items()
        if ours.floor != BASE and ours.direction != "z" and not channel.vertical
    }
    if not floors:
        raise recording.file.error(
            "there is no horizontal motion of a floor; add columns 2F ... RF"
        )
    file, channels = recording.file, list(floors.values())
    units, kinds = ({getattr(c, name) for c in channels} for name in ("unit", "quantity"))
    if len(kinds) > 1:
        raise file.error(
            f"the channels hold {' and '.join(sorted(kinds))}; take channels of one quantity by the"
            " columns option"
        )
    for channel in channels:
        if np.ptp(channel.values) == 0.0:
            raise file.error(
                f"channel {channel.name!r} is dead: all its values are the same; leave it out"
            )
        if np.abs(channel.values).max() > 1e9:  # of any unit
            raise file.error(
                f"channel {channel.name!r} holds values above 1e+09; remove the spikes"
            )
    if None in units and len(units) > 1:
        raise file.error("some channels have a unit and some have none; give every one its unit")
    values = np.array([channel.values for channel in channels])
    if len(units) > 1:  # one that all have need not be known
        factors = [si_factor(file, channel.unit or "", channel.quantity) for channel in channels]
        values *= np.array(factors)[:, None]
    names = tuple(ours.name for ours in floors)
    found = identify_modes(values, channels[0].time_step, names, band_hz, order)
    said = [f"modes of {path.name} by femupdate identify", *found.notes]
    return _modes_told(found, path, write_modes(output, found.modes, said))


def _modes_told(found: AmbientModes, path: Path, written: Path) -> Told:
    """Every mode, what was left out, and the next command."""
    heads = {"name": "mode", "frequency_hz": "frequency", "damping": "damping ratio"}
    hertz = [with_unit(m.frequency_hz, m.frequency_sd_hz or 0.0, "Hz") for m in found.modes]
    shares = [(100.0 * (m.damping or 0.0), 100.0 * (m.damping_sd or 0.0)) for m in found.modes]
    told = {"frequency_hz": hertz, "damping": [with_unit(*share, "%") for share in shares]}
    keys = ("name", "frequency_hz", "frequency_sd_hz", "damping", "damping_sd", "shape")
    values = {key: [getattr(mode, key) for mode in found.modes] for key in keys}
    columns = (Column(values[key], heads.get(key), told.get(key), key=key) for key in keys)
    table = Table(name="modes", key="modes", columns=tuple(columns))
    findings, following = mode_findings(found.modes), f"femupdate calibrate {written}"
    content = {"band_hz": found.band_hz, "notes": found.notes, "findings": findings}

    def drawn() -> "Figure":
        from femupdate.report.plot_measured import stabilisation

        return stabilisation(found, f"Modes identified from {path.name}")

    return Told(
        (
            Note(f"Modes of {path.name}, to {written}:", {"output": written}),
            table,
            Notes((*found.notes, *findings)),
            Note(f"Next: {following}", {**content, "next": following}),
        ),
        [Picture("modes", drawn)],
    )
