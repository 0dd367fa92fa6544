"""What a reader of a file format is, the one that a file needs, and what a file tells."""

import importlib
import pkgutil
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from femupdate.errors import MeasurementError
from femupdate.measurement import readers as folder
from femupdate.measurement.frf_table import frfs_in_table, table_of_functions
from femupdate.measurement.modes import IdentifiedModes, identified_modes
from femupdate.measurement.names import TIME
from femupdate.measurement.observation import (
    DEFAULT_NOISE,
    Histories,
    Observation,
    histories_of,
)
from femupdate.measurement.recording import Recording, in_step
from femupdate.measurement.resolve import placed_channels, resolved, table_channels
from femupdate.measurement.text import read_head, read_text


class Reader(Protocol):
    """One file format: a module of the folder `readers`, whose name is that of the format.

    With `FALLBACK = True` it is tried after all others, for a layout that nearly every file fits.
    """

    READS: str  # what it reads, for lists and messages

    def recognises(self, head: str, suffix: str) -> bool:
        """Whether a file is in the format.

        Args:
            head: its beginning as text; bytes that are not text stand as latin-1.
            suffix: such as `.v2`.
        """

    def read(self, path: Path) -> Recording:
        """What the file holds.

        Raises:
            MeasurementError: it cannot be used; `TextFile.error` puts file, line and column in
                front of the message.
        """


# Comments, and the name of the first column as femupdate writes it: no other format begins so.
_OWN_TABLE = re.compile(r"(?:#[^\n]*\n)*time_s,")


@cache
def readers() -> Mapping[str, Reader]:
    """Readers by their names, in the order in which they are tried."""
    names = sorted(info.name for info in pkgutil.iter_modules(folder.__path__))
    known: dict[str, Any] = {
        name: importlib.import_module(f"{folder.__name__}.{name}") for name in names
    }
    ordered = sorted(known.items(), key=lambda item: getattr(item[1], "FALLBACK", False))
    return MappingProxyType(dict(ordered))


def read_measured(path: str | Path) -> Recording:
    """Read any measured file.

    Raises:
        MeasurementError: the file is in no known format, or cannot be read as what it is.
    """
    path = Path(path)
    head, name = read_head(path), "plain"
    if path.suffix.lower() != ".csv" or not _OWN_TABLE.match(head):
        fits = (n for n, each in readers().items() if each.recognises(head, path.suffix.lower()))
        name = next(fits, "")
    if not name:
        file = read_text(path)  # says what it is where it is no text
        cure = "convert it to CSV"
        if path.suffix.lower() in (".csv", ".txt"):
            cure = "a table has a row that names its columns, then a row for each time or mode"
        raise file.error(
            f"the file is in none of the known formats, which `femupdate list` names; {cure}"
        )
    recording = read_as(name, path)
    channels = in_step(recording.file, dict(enumerate(recording.channels)))
    return replace(recording, channels=tuple(channels.values()), format=name)


def read_as(name: str, path: Path) -> Recording:
    """Read a file by the reader of a name, however it is damaged."""
    try:
        return readers()[name].read(path)
    except MeasurementError:
        raise
    except Exception as error:  # packages raise nearly anything; most of it is in Python's words
        why = f" ({error})" if isinstance(error, (OSError, ValueError, RuntimeError)) else ""
        raise MeasurementError(
            f"{path}: it is read as one of {readers()[name].READS}, but is damaged{why}; write it"
            " again from its source, or export it as CSV"
        ) from error


AnyKind = Histories | tuple[Observation, ...] | IdentifiedModes


def read_observation_file(
    path: str | Path, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | Observation:
    """Read measured histories or response functions of floors under base motion.

    Args:
        path: a table with the column time_s (histories) or frequency_hz (FRFs), or any other
            format that is known, whose channels `columns` gives to floors.
        unit: of the accelerations, where the file does not give it.
        columns: our column name to the file's column or channel, such as `{"2F": "a_1F"}`; a
            channel also by its number. Once it is given, the file's other columns count only
            where they bear one of our names.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used, or the file is of another
            kind; the message names it.
    """
    return base_motion_in(read_measured(path), unit, columns)


def base_motion_in(
    recording: Recording, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | Observation:
    """What `read_observation_file` reads, in a file that was opened."""
    found = kind_in(recording, unit, columns)
    what = "identified modes"
    if not isinstance(found, IdentifiedModes):
        first = found if isinstance(found, Histories) else found[0]
        if not first.excitation.force:
            return first
        what = "responses to a force"
    raise recording.file.error(
        f"these are {what}, which calibrate, diagnose and repair explain; give histories or FRFs"
        " here"
    )


def kind_in(
    recording: Recording,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    direction: str = "x",
    force: str | None = None,
    noise: float = DEFAULT_NOISE,
) -> AnyKind:
    """What a file holds; of FRFs an observation for each excitation, at the file's frequencies.

    Args:
        unit: of accelerations, or of responses to a force, where the file does not give it.
        direction: of the motion; of identified modes other components are left out.
        force: floor at which the force acts, where the columns' names do not say it.
        noise: standard deviation of ln|H| where a table of FRFs gives none.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used; the message names it.
    """
    if recording.modes or recording.mode_table is not None:
        return identified_modes(recording, columns, direction)
    file, table = recording.file, recording.table
    if table is None and recording.functions and not recording.channels:
        table, columns = table_of_functions(recording, columns or {}), None
    if table is None:
        return histories_of(file, placed_channels(recording, columns, unit), unit)
    table = resolved(table, columns)
    if table.axis == TIME:
        return histories_of(file, table_channels(table), unit)
    return frfs_in_table(table, force, unit, noise)
