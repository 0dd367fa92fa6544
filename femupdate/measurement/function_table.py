"""Functions of frequency in tables, and those of a file with points as a table."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from femupdate.measurement.columns import BASE, FREQUENCY, FrfColumn
from femupdate.measurement.frf_table import without_zero_frequency
from femupdate.measurement.observation_file import Layout
from femupdate.measurement.quantity import force_unit
from femupdate.measurement.recording import RecordedFunction, Recording
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile

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
    chosen = {ours: _chosen(file, known, theirs, listing) for ours, theirs in columns.items()}
    first = next(iter(chosen.values()))
    for one in chosen.values():
        if not np.array_equal(one.frequency_hz, first.frequency_hz):
            raise file.error("the response functions are not at the same frequencies; split them")
    names, units, values = [FREQUENCY], ["Hz"], [first.frequency_hz]
    for ours, one in chosen.items():
        names += [f"{ours}_re", f"{ours}_im"]
        units += [one.unit or ""] * 2
        values += [np.real(one.values), np.imag(one.values)]
    stated = tuple(unit or None for unit in units)
    lines = np.arange(1, first.frequency_hz.size + 1)
    return Table(file, tuple(names), stated, np.column_stack(values), lines)


def unnamed_functions(table: Table, at: int) -> tuple[RecordedFunction, ...]:
    """The functions in a table whose columns do not say their floors, by the file's names.

    Args:
        table: with names; a complex column has become two, `name_re` and `name_im`.
        at: position of the frequencies.
    """
    columns = {name: k for k, name in enumerate(table.names or ()) if k != at}
    found: dict[str, RecordedFunction] = {}
    for name, k in columns.items():
        whole = re.sub("_(re|im)$", "", name)
        parts = [columns.get(f"{whole}{part}") for part in ("_re", "_im")]
        real, imaginary = parts if None not in parts else (k, None)
        values = table.values[:, real]
        found.setdefault(
            name if imaginary is None else whole,
            RecordedFunction(
                kind="function",
                name=name if imaginary is None else whole,
                frequency_hz=table.values[:, at],
                values=values if imaginary is None else values + 1j * table.values[:, imaginary],
                unit=table.units[k],
            ),
        )
    return tuple(found.values())


def under_force(table: Table, layout: Layout) -> bool:
    """Whether the columns of a table say that they are responses to a force."""
    return any(
        column.force or (column.part != "sd" and force_unit(table.units[i] or "") is not None)
        for column, i in layout.frfs.items()
    )


def response_functions(table: Table, layout: Layout) -> tuple[RecordedFunction, ...]:
    """The responses of floors to the base or to a force in a table, in the file's units."""
    table = without_zero_frequency(table, layout.at)
    forced, found = under_force(table, layout), []
    for column, i in layout.frfs.items():
        if column.part not in ("abs", "re"):
            continue
        imaginary = layout.frfs.get(FrfColumn(column.floor, "im", column.force))
        values = table.values[:, i]
        if column.part == "re" and imaginary is not None:
            values = values + 1j * table.values[:, imaginary]
        somewhere = SOMEWHERE if forced else BASE
        found.append(
            RecordedFunction(
                kind="frequency response",
                name=column.floor,
                frequency_hz=np.asarray(table.values[:, layout.at]),
                values=values,
                unit=table.units[i] if forced else None,
                response=column.floor,
                reference=f"a force at {column.force}" if column.force else somewhere,
            )
        )
    return tuple(found)


def _listing(functions: Sequence[RecordedFunction]) -> str:
    told = [
        f"{k} = {one.response or one.name}/{one.reference or 'not said'} ({one.unit or 'no unit'})"
        for k, one in enumerate(functions[:_SHOWN], start=1)
    ]
    return ", ".join(told) + (", ..." if len(functions) > _SHOWN else "")


def _chosen(
    file: TextFile, functions: Sequence[RecordedFunction], asked: str, listing: str
) -> RecordedFunction:
    if asked.isdecimal() and 1 <= int(asked) <= len(functions):
        return functions[int(asked) - 1]
    found = [one for one in functions if asked in (f"{one.response}/{one.reference}", one.name)]
    if len(found) != 1:
        problem = "there is no function" if not found else f"{len(found)} functions are called"
        raise file.error(f"{problem} {asked!r}; choose by number: {listing}")
    return found[0]
