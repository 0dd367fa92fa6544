"""Responses to a force in a table, before it is known whether all is said of them."""

import numpy as np

from femupdate.measurement.columns import FrfColumn
from femupdate.measurement.force_unit import force_unit
from femupdate.measurement.observation_file import Layout
from femupdate.measurement.recording import RecordedFunction
from femupdate.measurement.table import Table

SOMEWHERE = "a force somewhere"


def under_force(table: Table, layout: Layout) -> bool:
    """Whether the columns of a table say that they are responses to a force."""
    return any(column.force or _unit(table, column, i) for column, i in layout.frfs.items())


def force_functions(table: Table, layout: Layout) -> tuple[RecordedFunction, ...]:
    """The responses of a table, in the file's units."""
    frequency = table.values[:, layout.at]
    found = []
    for column, i in layout.frfs.items():
        if column.part not in ("abs", "re"):
            continue
        imaginary = layout.frfs.get(FrfColumn(column.floor, "im", column.force))
        values = table.values[:, i]
        if column.part == "re" and imaginary is not None:
            values = values + 1j * table.values[:, imaginary]
        found.append(
            RecordedFunction(
                kind="frequency response",
                name=column.floor,
                frequency_hz=np.asarray(frequency),
                values=values,
                unit=table.units[i],
                response=column.floor,
                reference=f"a force at {column.force}" if column.force else SOMEWHERE,
            )
        )
    return tuple(found)


def _unit(table: Table, column: FrfColumn, position: int) -> bool:
    unit = table.units[position]
    return column.part != "sd" and unit is not None and force_unit(unit) is not None
