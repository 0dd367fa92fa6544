"""Tables of measured frequency response functions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Complexes, Floats
from femupdate.measurement.columns import FREQUENCY, FRF_COLUMNS, floor_height
from femupdate.measurement.resolve import Layout, whole_or_parts
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


def frf_table(layout: Layout) -> FrfTable:
    """Return the response functions in a table.

    Raises:
        MeasurementError: the frequencies do not increase, a floor lacks a part of its response
            function, or a magnitude or standard deviation is not above zero.
    """
    units = layout.force_units
    if units:
        raise layout.table.file.error(
            f"a response in {units[0]} is one to a force; say at which floor it acts by the force"
            " option, or by the columns' names, such as 2F/RF for 2F under a force at RF"
        )
    return curves_of(layout, _ratio)


def curves_of(
    layout: Layout,
    values: Callable[[Table, int], Floats],
    possible: tuple[float, float] = (RESPONSE.least, RESPONSE.largest),
) -> FrfTable:
    """Return the curves in a table, all under one excitation.

    Args:
        values: (r,) of the table's column at a position, in SI units.
        possible: smallest and largest amplitude that a building can have.

    Raises:
        MeasurementError: see `frf_table`.
    """
    table, frequency = layout.table, layout.frequency_hz
    _check_frequencies(table, frequency)
    floors = tuple(sorted({column.floor for column in layout.frfs}, key=floor_height))
    if not floors:
        raise table.file.error(f"there is no column of a floor; columns are {FRF_COLUMNS}")
    columns = {column.name: i for column, i in layout.frfs.items()}
    curves = [_curve(table, floor, columns, values, possible) for floor in floors]
    log_sd = np.array([_log_sd(table, columns.get(f"{floor}_sd")) for floor in floors])
    whole = all(np.iscomplexobj(curve) for curve in curves)
    return FrfTable(
        frequency_hz=frequency,
        floors=floors,
        magnitude=np.abs(np.array(curves)),
        complex_frf=np.array(curves) if whole else None,
        log_sd=None if np.isnan(log_sd).all() else log_sd,
        source=table.file.path.name,
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
    columns: Mapping[str, int],
    values: Callable[[Table, int], Floats],
    possible: tuple[float, float],
) -> NDArray[np.inexact]:
    """Return |H| or H of a floor, (m,), whichever the table has."""
    at, imaginary = whole_or_parts(table.file, floor, columns, f"|H| of floor {floor}")
    real = values(table, at)
    curve = real if imaginary is None else real + 1j * values(table, imaginary)
    _require_possible(table, at, real if imaginary is None else np.abs(curve), "|H|", possible)
    return curve


def _log_sd(table: Table, position: int | None) -> Floats:
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
