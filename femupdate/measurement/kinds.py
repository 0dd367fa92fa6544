"""What a file tells of a building: histories, response functions or identified modes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from femupdate.measurement.force_frf import ForceTest, force_test
from femupdate.measurement.frf_table import FrfTable, frf_table
from femupdate.measurement.function_table import table_of_functions
from femupdate.measurement.modes import IdentifiedModes, identified_modes
from femupdate.measurement.observation_file import (
    ForceHistories,
    Histories,
    histories_of,
)
from femupdate.measurement.quantity import force_unit
from femupdate.measurement.recording import Recording
from femupdate.measurement.registry import read_measured
from femupdate.measurement.resolve import layout_of, placed_channels

AnyKind = Histories | ForceHistories | FrfTable | ForceTest | IdentifiedModes


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How a file is read.

    Attributes:
        unit: of accelerations, or of responses to a force, where the file does not give it.
        columns: our column name to the file's.
        direction: of the motion; of identified modes other components are left out.
        force: floor at which the force acts, where the columns' names do not say it.
    """

    unit: str | None = None
    columns: Mapping[str, str] | None = None
    direction: str = "x"
    force: str | None = None


def read_any_kind(path: str | Path, how: Reading) -> AnyKind:
    """Read a measured file of any kind.

    Args:
        how: see `Reading`.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used; the message names it.
    """
    return kind_in(read_measured(path), how)


def read_observation_file(
    path: str | Path, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | FrfTable:
    """Read measured histories or response functions of floors under base motion.

    Args:
        path: a table with the column time_s (histories) or frequency_hz (FRFs), or any other
            format that is known, whose channels `columns` gives to floors.
        unit: of the accelerations, where the file does not give it.
        columns: our column name to the file's column or channel, such as `{"2F": "a_1F"}`; a
            channel also by its number. Once it is given, the file's other columns count only
            where they bear one of our names.

    Raises:
        MeasurementError: as `read_any_kind`, or the file is of another kind.
    """
    return base_motion_in(read_measured(path), unit, columns)


def base_motion_in(
    recording: Recording, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | FrfTable:
    """What `read_observation_file` reads, in a file that was opened."""
    found = kind_in(recording, Reading(unit=unit, columns=columns))
    if isinstance(found, Histories | FrfTable):
        return found
    what, who = _OTHERS.get(type(found), _FORCED)
    raise recording.file.error(f"these are {what}, which {who}; give histories or FRFs here")


_EXPLAINED = "calibrate, diagnose and repair explain"
_FORCED = "responses to a force", _EXPLAINED
_OTHERS: Mapping[type, tuple[str, str]] = {
    IdentifiedModes: ("identified modes", _EXPLAINED),
}


def kind_in(recording: Recording, how: Reading) -> AnyKind:
    """What `read_any_kind` reads, in a file that was opened."""
    if recording.modes or recording.mode_table is not None:
        return identified_modes(recording, how.columns, how.direction)
    file, table, columns = recording.file, recording.table, how.columns
    if table is None and recording.functions and not recording.channels:
        table, columns = table_of_functions(recording, columns or {}), None
    if table is None:
        return histories_of(file, placed_channels(recording, columns, how.unit), how.unit)
    layout = layout_of(table, columns)
    if layout.of_histories:
        return histories_of(file, layout.channels(), how.unit)
    told = how.force or any(column.force for column in layout.frfs)
    if layout.frfs and (told or force_unit(how.unit or "")):
        return force_test(layout, how.force, how.unit)
    return frf_table(layout)
