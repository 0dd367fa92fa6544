"""What a file tells of a building: histories, response functions or identified modes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from femupdate.measurement.columns import FrfColumn
from femupdate.measurement.force_frf import ForceTest, force_test
from femupdate.measurement.force_unit import force_unit
from femupdate.measurement.frf_table import FrfTable
from femupdate.measurement.function_table import table_of_functions
from femupdate.measurement.modes import IdentifiedModes, identified_modes
from femupdate.measurement.observation_file import (
    ForceHistories,
    Histories,
    Layout,
    any_observation_in,
    layout_of,
)
from femupdate.measurement.recording import Recording
from femupdate.measurement.registry import read_measured
from femupdate.measurement.static_test import StaticTest, is_static, static_test
from femupdate.measurement.table import Table

AnyKind = Histories | ForceHistories | FrfTable | ForceTest | StaticTest | IdentifiedModes


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
    recording = read_measured(path)
    if recording.modes or recording.mode_table is not None:
        return identified_modes(recording, how.columns, how.direction)
    table = recording.table
    if table is None and recording.functions and not recording.channels:
        table = table_of_functions(recording, how.columns or {})
        return _from_table(Recording(recording.file, table=table), table, how, None)
    if table is None:
        return any_observation_in(recording, how.unit, how.columns)
    if is_static(table):
        return static_test(table)
    return _from_table(recording, table, how, how.columns)


def _from_table(
    recording: Recording, table: Table, how: Reading, columns: Mapping[str, str] | None
) -> Histories | ForceHistories | FrfTable | ForceTest:
    layout = layout_of(table, columns)
    if not _forced(table, layout, how):
        own = how.unit if layout.of_histories else None
        return any_observation_in(recording, own, columns)
    _check_force(table, layout.frfs, how.force)
    return force_test(table, layout.at, layout.frfs, how.force or "", how.unit)


def _forced(table: Table, layout: Layout, how: Reading) -> bool:
    """Whether a table holds responses to a force."""
    if layout.of_histories or not layout.frfs:
        return False
    told = how.force is not None or any(column.force for column in layout.frfs)
    return told or (how.unit is not None and force_unit(how.unit) is not None)


def _check_force(table: Table, columns: Mapping[FrfColumn, int], force: str | None) -> None:
    """Refuse columns of which nobody says where the force acts, or two say different floors."""
    silent = next((i for column, i in columns.items() if not column.force), None)
    if silent is not None and force is None:
        raise table.file.error(
            "the floor at which the force acts is not said; name it by the force option, or by"
            " the column's name, such as 2F/RF for 2F under a force at RF",
            column=table.title(silent),
        )
    other = next((i for column, i in columns.items() if column.force not in ("", force)), None)
    if other is not None and force is not None:
        raise table.file.error(
            f"the column says another floor than the force option, {force}; leave the option out",
            column=table.title(other),
        )
