"""Measured FRFs in tables, and functions of frequency in other files with points as a table.

Responses to a force of a hammer or a shaker are given on as accelerance whatever the file holds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.dynamics.excitation import Excitation
from femupdate.errors import MeasurementError
from femupdate.measurement.names import (
    BASE,
    FREQUENCY,
    FRF_COLUMNS,
    QUANTITIES,
    FrfColumn,
    floor_height,
    force_unit,
)
from femupdate.measurement.observation import (
    DEFAULT_NOISE,
    Observation,
    at_frequencies,
    require_floors_of_building,
    select_floors,
)
from femupdate.measurement.recording import RecordedFunction, Recording
from femupdate.measurement.resolve import in_parts, positions, whole_or_parts
from femupdate.measurement.table import ColumnTable

SOMEWHERE = "a force somewhere"
_RESPONSES = ("frequency response", "transmissibility")
_RATIO_UNITS = ("", "-", "–", "1")
_UNITS = "m/s2/N (accelerance), m/s/N (mobility) or m/N (receptance)"


def frfs_in_table(
    table: ColumnTable,
    force: str | None = None,
    unit: str | None = None,
    noise: float = DEFAULT_NOISE,
) -> tuple[Observation, ...]:
    """The FRFs in a table, an observation for each excitation, at the table's own frequencies."""
    frfs = table.frfs
    told = force or any(column.force for column in frfs)
    if not frfs or not (told or force_unit(unit or "")):
        if table.force_units:
            raise table.file.error(
                f"a response in {table.force_units[0]} is one to a force; say at which floor it"
                " acts by the force option, or by the columns' names, such as 2F/RF for 2F under a"
                " force at RF"
            )
        values = {i: _ratio(table, i) for i in frfs.values()}
        # Two modes may cancel, but only to 1e-9. A damping ratio of 1e-4 amplifies 5,000 times.
        return (_observation(table, values, (1e-9, 1e5), noise),)
    by_force: dict[str, dict[FrfColumn, int]] = {}
    for column, i in frfs.items():
        at = column.force or force
        if at is None:
            raise table.file.error(
                "the floor at which the force acts is not said; name it by the force option, or by"
                " the column's name, such as 2F/RF for 2F under a force at RF",
                column=table.title(i),
            )
        if force is not None and at != force:
            raise table.file.error(
                f"the column says another floor than the force option, {force}; leave the option"
                " out",
                column=table.title(i),
            )
        responses, plain = by_force.setdefault(at, {}), replace(column, force=at)
        if plain in responses:
            raise table.file.error(
                f"{table.title(i)} and {table.title(responses[plain])} are the same response;"
                " remove one"
            )
        responses[plain] = i
    parts = {at: {i: column for column, i in by_force[at].items()} for at in by_force}
    return tuple(
        _under_force(replace(table, known=parts[at]), at, unit, noise)
        for at in sorted(parts, key=floor_height)
    )


def _observation(
    table: ColumnTable, values: Mapping[int, Floats], possible: tuple[float, float], default: float
) -> Observation:
    """The curves in a table, all under one excitation."""
    frequency = table.frequency_hz
    if frequency.size < 3:
        raise table.file.error(
            f"{frequency.size} rows are no response function; modes are told by a column mode",
            int(table.lines[-1]),
        )
    floors = tuple(sorted({column.floor for column in table.frfs}, key=floor_height))
    if not floors:
        raise table.file.error(f"there is no column of a floor; columns are {FRF_COLUMNS}")
    columns = {column.name: i for column, i in table.frfs.items()}

    def require_possible(
        position: int, values: Floats, what: str, least: float, most: float
    ) -> None:
        wrong = np.flatnonzero(values <= 0)
        if wrong.size and what == "|H|":
            raise table.file.error(
                f"|H| is {values[wrong[0]]:g} and must be above zero; give |H| or both its parts"
                " (levels are named RF (dB), modes are told by a column mode)",
                int(table.lines[wrong[0]]),
                table.title(position),
            )
        odd = np.flatnonzero((values < least) | (values > most))
        if odd.size:
            raise table.file.error(
                f"{what} is {values[odd[0]]:g}, and no measurement has one beyond {least:g} to"
                f" {most:g}; correct or remove the row",
                int(table.lines[odd[0]]),
                table.title(position),
            )

    curves: list[NDArray[np.inexact]] = []
    noise = np.full((len(floors), frequency.size), default)
    for row, floor in enumerate(floors):
        at, imaginary = whole_or_parts(table.file, floor, columns, f"|H| of floor {floor}")
        curve = values[at] if imaginary is None else values[at] + 1j * values[imaginary]
        size = values[at] if imaginary is None else np.abs(curve)
        require_possible(at, size, "|H|", *possible)
        curves.append(curve)
        stated = columns.get(f"{floor}_sd")
        if stated is not None:
            noise[row] = _ratio(table, stated)
            # Nothing is measured to 1e-5, and nothing of 100 is a measurement.
            require_possible(stated, noise[row], "the standard deviation of ln|H|", 1e-5, 100.0)
    without = [floor for floor in floors if f"{floor}_sd" not in columns]
    note = f"Noise on ln|H| taken as {default:g} for {', '.join(without)}."
    # Signs of columns in |H| are not known, so that phases are those of complex floors together.
    whole = all(np.iscomplexobj(curve) for curve in curves)
    return Observation(
        frequency_hz=frequency,
        floors=floors,
        log_frf=np.log(np.abs(np.array(curves))),
        noise_sd=noise,
        valid=np.ones(noise.shape, dtype=bool),
        phase=np.angle(np.array(curves)) if whole else None,
        source=table.file.path.name,
        notes=(note,) if without else (),
    )


def _under_force(table: ColumnTable, force: str, asked: str | None, noise: float) -> Observation:
    """The accelerance of floors, without phase: a sign or a phase of i omega does not matter."""
    omega = 2.0 * np.pi * table.frequency_hz
    values, quantities = {}, set()
    for column, i in table.frfs.items():
        if column.part == "sd":
            continue
        stated = table.units[i] or asked
        found = None if stated is None else force_unit(stated)
        if found is None:
            said = "has no unit" if stated is None else f"cannot be in {stated!r}"
            raise table.file.error(
                f"a response to a force {said}; give it by the unit option or in the column's"
                f" name, as {_UNITS}",
                column=table.title(i),
            )
        power, si = found
        quantities.add(QUANTITIES[power])
        values[i] = table.values[:, i] * si * omega ** (2 - power)
    if len(quantities) > 1:
        raise table.file.error(
            f"responses to the force at {force} are in several quantities,"
            f" {' and '.join(sorted(quantities))}; give them in files of their own"
        )
    # 1/kg, of a tower below its modes and of a toy at a mode.
    seen = _observation(table, values, (1e-18, 1e6), noise)
    (quantity,) = quantities or {"accelerance"}
    return replace(seen, phase=None, excitation=Excitation(force), quantity=quantity)


def in_band(
    forced: Observation, building_floors: Sequence[str], band_hz: tuple[float, float]
) -> Observation:
    """Responses to a force in a table on a building's floors, at the file's own frequencies.

    Args:
        band_hz: lowest and highest frequency at which the building's model is good.

    Raises:
        MeasurementError: the building has no such floor, or fewer than ten frequencies lie in the
            band.
    """
    named = (*forced.floors, forced.excitation.force)
    require_floors_of_building(forced.source, named, building_floors)
    low, high = band_hz
    slack = 1e-9  # grids are sums of rounded steps
    frequency = forced.frequency_hz
    used = (frequency >= low * (1.0 - slack)) & (frequency <= high * (1.0 + slack))
    # Ten frequencies are the least of a test.
    if np.count_nonzero(used) < 10:
        raise MeasurementError(
            f"{forced.source}: fewer than ten frequencies lie between {low:g} and {high:g} Hz,"
            " which the building's frequency grid and --band leave; widen them"
        )
    ordered = [name for name in building_floors if name in forced.floors]
    return replace(at_frequencies(select_floors(forced, ordered), used), resolution_hz=None)


def _ratio(table: ColumnTable, position: int) -> Floats:
    unit = (table.units[position] or "").strip()
    above, _, below = unit.partition("/")
    if unit not in _RATIO_UNITS and above != below:
        raise table.file.error(
            f"a response function is a ratio without unit, not {unit!r}; convert it and write -",
            column=table.title(position),
        )
    return table.values[:, position]


def table_of_functions(recording: Recording, columns: Mapping[str, str]) -> ColumnTable:
    """The response functions of a file that are given our names, as a table.

    Args:
        columns: our column name, such as `2F` or `2F/RF`, to the file's function: its number from
            1, or its points, as `point 3 +X/point 1 +X`.
    """
    file = recording.file
    known = [function for function in recording.functions if function.kind in _RESPONSES]
    if not known:
        kinds = ", ".join(dict.fromkeys(function.kind for function in recording.functions))
        raise file.error(f"the file holds {kinds}; a response needs histories or FRFs")
    names = [f"{f.response or f.name}/{f.reference or 'not said'}" for f in known]
    shown = [
        f"{k} = {name} ({function.unit or 'no unit'})"
        for k, (name, function) in enumerate(zip(names, known, strict=True), start=1)
    ]
    listing = ", ".join(shown[:8]) + (", ..." if len(known) > 8 else "")
    if not columns:
        raise file.error(
            "say which floor each response function is, by the columns option, such as 2F/RF=1"
            f" for 2F under a force at RF; its functions are {listing}"
        )
    at = positions(file, "function", names, columns, listing)
    chosen = {ours: known[k] for ours, k in at.items()}
    first = next(iter(chosen.values()))
    for function in chosen.values():
        if not np.array_equal(function.frequency_hz, first.frequency_hz):
            raise file.error("the response functions are not at the same frequencies; split them")
    # Complex whatever they are: a real one may be below zero.
    values = {ours: function.values.astype(np.complex128) for ours, function in chosen.items()}
    units = {ours: function.unit for ours, function in chosen.items()}
    return ColumnTable.of_arrays(file, {FREQUENCY: first.frequency_hz, **values}, units)


def unnamed_functions(table: ColumnTable) -> tuple[RecordedFunction, ...]:
    """The functions in a table whose columns do not say their floors, by the file's names."""
    columns = {name: k for k, name in enumerate(table.names or ()) if k != table.at}
    return tuple(
        _function(table, "function", name, parts, table.units[parts[0]])
        for name, parts in in_parts(columns).items()
    )


def response_functions(table: ColumnTable) -> tuple[RecordedFunction, ...]:
    """The responses of floors to the base or to a force in a table, in the file's units."""
    forced = table.force_units or any(column.force for column in table.frfs)
    columns: dict[str, dict[str, int]] = {}
    for column, i in table.frfs.items():
        if column.part != "sd":
            columns.setdefault(column.force, {})[column.name] = i
    functions = [
        (force, _function(table, "frequency response", name, parts, unit))
        for force, places in columns.items()
        for name, parts in in_parts(places).items()
        for unit in (table.units[parts[0]] if forced else None,)
    ]
    somewhere = SOMEWHERE if forced else BASE
    return tuple(
        replace(f, response=f.name, reference=f"a force at {force}" if force else somewhere)
        for force, f in functions
    )


def _function(
    table: ColumnTable, kind: str, name: str, parts: tuple[int, int | None], unit: str | None
) -> RecordedFunction:
    at, imaginary = parts
    values = table.values[:, at]
    values = values if imaginary is None else values + 1j * table.values[:, imaginary]
    return RecordedFunction(
        kind=kind, name=name, frequency_hz=table.frequency_hz, values=values, unit=unit
    )
