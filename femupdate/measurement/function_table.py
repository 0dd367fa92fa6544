"""Functions of frequency in tables, and those of a file with points as a table."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from femupdate.measurement.columns import BASE, FREQUENCY
from femupdate.measurement.recording import RecordedFunction, Recording
from femupdate.measurement.resolve import Layout, in_parts, positions
from femupdate.measurement.table import Table

SOMEWHERE = "a force somewhere"
_RESPONSES = ("frequency response", "transmissibility")
_SHOWN = 8


def table_of_functions(recording: Recording, columns: Mapping[str, str]) -> Table:
    """The response functions of a file that are given our names, as a table.

    Args:
        columns: our column name, such as `2F` or `2F/RF`, to the file's function: its number from
            1, or its points, as `point 3 +X/point 1 +X`.

    Raises:
        MeasurementError: there is no response function, none is given a name, a name is not known,
            or two differ in their frequencies.
    """
    file = recording.file
    known = [one for one in recording.functions if one.kind in _RESPONSES]
    if not known:
        kinds = ", ".join(dict.fromkeys(one.kind for one in recording.functions))
        raise file.error(f"the file holds {kinds}; a response needs histories or FRFs")
    listing = _listing(known)
    if not columns:
        raise file.error(
            "say which floor each response function is, by the columns option, such as 2F/RF=1"
            f" for 2F under a force at RF; its functions are {listing}"
        )
    names = [f"{one.response or one.name}/{one.reference or 'not said'}" for one in known]
    at = positions(file, "function", names, columns, listing)
    chosen = {ours: known[k] for ours, k in at.items()}
    first = next(iter(chosen.values()))
    for one in chosen.values():
        if not np.array_equal(one.frequency_hz, first.frequency_hz):
            raise file.error("the response functions are not at the same frequencies; split them")
    # Complex whatever they are: a real one may be below zero.
    values = {ours: one.values.astype(np.complex128) for ours, one in chosen.items()}
    units = {ours: one.unit for ours, one in chosen.items()}
    return Table.of_arrays(file, {FREQUENCY: first.frequency_hz, **values}, units)


def unnamed_functions(table: Table, at: int) -> tuple[RecordedFunction, ...]:
    """The functions in a table whose columns do not say their floors, by the file's names.

    Args:
        table: with names; a complex column has become two, `name_re` and `name_im`.
        at: position of the frequencies.
    """
    columns = {name: k for k, name in enumerate(table.names or ()) if k != at}
    return tuple(
        RecordedFunction(
            kind="function",
            name=name,
            frequency_hz=table.values[:, at],
            values=_values(table, *parts),
            unit=table.units[parts[0]],
        )
        for name, parts in in_parts(columns).items()
    )


def response_functions(layout: Layout) -> tuple[RecordedFunction, ...]:
    """The responses of floors to the base or to a force in a table, in the file's units."""
    table, forced = layout.table, layout.under_force
    columns: dict[str, dict[str, int]] = {}
    for column, i in layout.frfs.items():
        if column.part != "sd":
            columns.setdefault(column.force, {})[column.name] = i
    somewhere = SOMEWHERE if forced else BASE
    return tuple(
        RecordedFunction(
            kind="frequency response",
            name=name,
            frequency_hz=layout.frequency_hz,
            values=_values(table, *parts),
            unit=table.units[parts[0]] if forced else None,
            response=name,
            reference=f"a force at {force}" if force else somewhere,
        )
        for force, own in columns.items()
        for name, parts in in_parts(own).items()
    )


def _values(table: Table, at: int, imaginary: int | None) -> NDArray[np.inexact]:
    whole = table.values[:, at]
    return whole if imaginary is None else whole + 1j * table.values[:, imaginary]


def _listing(functions: Sequence[RecordedFunction]) -> str:
    told = [
        f"{k} = {one.response or one.name}/{one.reference or 'not said'} ({one.unit or 'no unit'})"
        for k, one in enumerate(functions[:_SHOWN], start=1)
    ]
    return ", ".join(told) + (", ..." if len(functions) > _SHOWN else "")
