"""Tables of measured frequency response functions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Complexes, Floats
from femupdate.measurement.columns import FREQUENCY, FRF_COLUMNS, FrfColumn, floor_height
from femupdate.measurement.quantity import force_unit, si_factor
from femupdate.measurement.table import Table
from femupdate.measurement.thresholds import RESPONSE

_RATIO_UNITS = ("", "-", "–", "1")


@dataclass(frozen=True, eq=False)
class FrfTable:
    """Frequency response functions: absolute floor acceleration over base acceleration.

    Attributes:
        frequency_hz: (m,) increasing.
        floors: (f,) bottom to top.
        magnitude: (f, m) |H|, above zero.
        complex_frf: (f, m) H, where every floor has its real and imaginary part, else None.
        log_sd: (f, m) standard deviation of ln|H|, NaN on floors without one; None without any.
        source: where it comes from, for messages and reports.
    """

    frequency_hz: Floats
    floors: tuple[str, ...]
    magnitude: Floats
    complex_frf: Complexes | None = None
    log_sd: Floats | None = None
    source: str = "FRF table"


def frf_table(table: Table, at: int, columns: Mapping[FrfColumn, int]) -> FrfTable:
    """Return the response functions in a table.

    Args:
        at: position of the frequencies.
        columns: position of each column that is used.

    Raises:
        MeasurementError: the frequencies do not increase, a floor lacks a part of its response
            function, or a magnitude or standard deviation is not above zero.
    """
    units = [table.units[i] or "" for column, i in columns.items() if column.part != "sd"]
    forced = next((unit for unit in units if force_unit(unit)), None)
    if forced is not None and not any(column.force for column in columns):
        raise table.file.error(
            f"a response in {forced} is one to a force; say at which floor it acts by the force"
            " option, or by the columns' names, such as 2F/RF for 2F under a force at RF"
        )
    return curves_of(without_zero_frequency(table, at), at, columns, _ratio)


def without_zero_frequency(table: Table, at: int) -> Table:
    """Return the same rows but the first, where its frequency is zero: nothing accelerates there.

    Args:
        table: the file's columns.
        at: position of the frequencies.
    """
    if table.values[0, at] != 0.0:
        return table
    return replace(table, values=table.values[1:], lines=table.lines[1:])


def curves_of(
    table: Table,
    at: int,
    columns: Mapping[FrfColumn, int],
    values: Callable[[Table, int], Floats],
    possible: tuple[float, float] = (RESPONSE.least, RESPONSE.largest),
) -> FrfTable:
    """Return the curves in some columns of a table, all under one excitation.

    Args:
        at, columns: see `frf_table`.
        values: (r,) of the table's column at a position, in SI units.
        possible: smallest and largest amplitude that a building can have.

    Raises:
        MeasurementError: see `frf_table`.
    """
    file = table.file
    frequency = table.values[:, at] * si_factor(file, table.units[at] or "Hz", "frequency")
    _check_frequencies(table, frequency)
    floors = tuple(sorted({column.floor for column in columns}, key=floor_height))
    if not floors:
        raise file.error(f"there is no column of a floor; columns are {FRF_COLUMNS}")
    at_floor = {(column.floor, column.part): i for column, i in columns.items()}
    curves = [_curve(table, floor, at_floor, values, possible) for floor in floors]
    log_sd = np.array([_log_sd(table, floor, at_floor) for floor in floors])
    whole = all(np.iscomplexobj(curve) for curve in curves)
    return FrfTable(
        frequency_hz=frequency,
        floors=floors,
        magnitude=np.abs(np.array(curves)),
        complex_frf=np.array(curves) if whole else None,
        log_sd=None if np.isnan(log_sd).all() else log_sd,
        source=file.path.name,
    )


def _check_frequencies(table: Table, frequency: Floats) -> None:
    if frequency.size < RESPONSE.fewest:
        raise table.file.error(
            f"{frequency.size} rows are no response function; give at least {RESPONSE.fewest}",
            int(table.lines[-1]),
        )
    wrong = np.flatnonzero((np.diff(frequency, prepend=-1.0) <= 0) | (frequency < 0))
    if wrong.size:
        raise table.file.error(
            "the frequencies must be zero or above and increase; sort the rows by frequency",
            int(table.lines[wrong[0]]),
            FREQUENCY,
        )


def _curve(
    table: Table,
    floor: str,
    columns: Mapping[tuple[str, str], int],
    values: Callable[[Table, int], Floats],
    possible: tuple[float, float],
) -> NDArray[np.inexact]:
    """Return |H| or H of a floor, (m,), whichever the table has."""
    magnitude, real, imaginary = (columns.get((floor, part)) for part in ("abs", "re", "im"))
    if magnitude is not None and real is None and imaginary is None:
        size = values(table, magnitude)
        _require_possible(table, magnitude, size, "|H|", possible)
        return size
    if magnitude is None and real is not None and imaginary is not None:
        curve = values(table, real) + 1j * values(table, imaginary)
        _require_possible(table, real, np.abs(curve), "|H|", possible)
        return curve
    raise table.file.error(
        f"floor {floor} must have either the column {floor} (|H|) or both {floor}_re and"
        f" {floor}_im; complete the one or remove the other"
    )


def _log_sd(table: Table, floor: str, columns: Mapping[tuple[str, str], int]) -> Floats:
    position = columns.get((floor, "sd"))
    if position is None:
        return np.full(table.values.shape[0], np.nan)
    values = _ratio(table, position)
    _require_possible(
        table,
        position,
        values,
        "the standard deviation of ln|H|",
        (RESPONSE.least_sd, RESPONSE.largest_sd),
    )
    return values


def _ratio(table: Table, position: int) -> Floats:
    unit = (table.units[position] or "").strip()
    above, _, below = unit.partition("/")
    if unit not in _RATIO_UNITS and above != below:
        raise table.file.error(
            f"a response function is a ratio without unit, not {unit!r}; convert it and write -",
            column=table.title(position),
        )
    return table.values[:, position]


def _require_possible(
    table: Table, position: int, values: Floats, what: str, possible: tuple[float, float]
) -> None:
    least, most = possible
    wrong = np.flatnonzero(values <= 0)
    if wrong.size:
        raise table.file.error(
            f"{what} is {values[wrong[0]]:g} and must be above zero; give |H| or both its parts"
            " (modes are told by a column mode), or remove the row",
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
