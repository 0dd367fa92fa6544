"""Tables of identified modes: one row a mode, any figure but the frequency may be missing."""

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.measurement.columns import FREQUENCY, parse_channel
from femupdate.measurement.quantity import si_factor
from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.resolve import renamed_columns, whole_or_parts
from femupdate.measurement.table import Table
from femupdate.measurement.text import closest

MODE, FREQUENCY_SD, DAMPING, DAMPING_SD = "mode", "frequency_sd_hz", "damping", "damping_sd"
MODE_COLUMNS = (
    f"{MODE}, {FREQUENCY}, {FREQUENCY_SD}, {DAMPING}, {DAMPING_SD}, and shapes 2F ... RF with"
    " 2F_sd ..., or 2F_re and 2F_im"
)
_NAMED = (MODE, FREQUENCY, FREQUENCY_SD, DAMPING, DAMPING_SD)
_DEVIATION = r"(std|sd|standarddeviation)"
_FREQUENCY = r"(f|fn|fid|(natural|modal)?freq(uency|uencies|s)?)"
_DAMPING = r"(xi|zeta|ξ|ζ|(modal)?damp(ing)?(ratios?)?)"
# Titles without blanks, points and underscores.
_TITLES = {
    MODE: r"mode(no|nr|number|name)?",
    FREQUENCY: rf"{_FREQUENCY}(hz)?",
    FREQUENCY_SD: rf"{_DEVIATION}{_FREQUENCY}(hz)?|{_FREQUENCY}{_DEVIATION}(hz)?",
    DAMPING: _DAMPING,
    DAMPING_SD: rf"{_DEVIATION}{_DAMPING}|{_DAMPING}{_DEVIATION}",
}
# What programs say of a mode besides.
_BESIDE = re.compile(r"(std\.?\s*)?complexity|mpc|mpd|mcf|comments?|remarks?|method", re.IGNORECASE)
_PART = re.compile(r"(?P<sensor>.+?)(?:_(?P<part>re|im|sd))?", re.IGNORECASE)


def modes_in_table(
    table: Table, columns: Mapping[str, str], named: bool = True
) -> tuple[RecordedMode, ...]:
    """The modes in the rows of a table, NaN and None where a cell is blank.

    Args:
        table: NaN where a cell is blank; of the column `mode` its numbers.
        columns: our column name to the file's.
        named: whether every component must bear our name of a floor; else it keeps its own.

    Raises:
        MeasurementError: there is no column of frequencies, a row has none, or a column has a
            name that is not known.
    """
    values = _columns(table, columns, named)
    if FREQUENCY not in values:
        raise table.file.error(
            f"there is no column {FREQUENCY}; columns of identified modes are {MODE_COLUMNS}"
        )
    frequency = values[FREQUENCY]
    blank = np.flatnonzero(np.isnan(frequency))
    if blank.size:
        raise table.file.error(
            "the mode has no frequency; give it or remove the row",
            int(table.lines[blank[0]]),
            FREQUENCY,
        )
    sensors, shape, sd = _shapes(table, values)
    numbers = values.get(MODE, np.arange(1.0, len(frequency) + 1.0))
    return tuple(
        RecordedMode(
            frequency_hz=float(frequency[row]),
            frequency_sd_hz=_cell(values, FREQUENCY_SD, row),
            damping=_cell(values, DAMPING, row),
            damping_sd=_cell(values, DAMPING_SD, row),
            sensors=sensors,
            shape=shape[row],
            shape_sd=sd[row],
            name=f"{numbers[row]:g}",
        )
        for row in range(len(frequency))
    )


def _columns(table: Table, columns: Mapping[str, str], named: bool) -> dict[str, Floats]:
    """Values (r,) of every column that is used, by our name, in SI units."""
    renamed = renamed_columns(table, columns)
    values: dict[str, Floats] = {}
    for position, title in enumerate(table.names or ()):
        known = _known_name(renamed.get(position, title))
        beside = _BESIDE.fullmatch(title) is not None
        if known is None and position not in renamed and (columns or beside):
            continue
        if known is None and not named:
            known = title
        if known is None:
            raise table.file.error(
                f"unknown column {title!r}{closest(title, _NAMED)}; columns of identified modes"
                f" are {MODE_COLUMNS}: rename it or map it by the columns option"
            )
        values[known] = table.values[:, position] * _factor(table, known, position)
    return values


def _known_name(name: str) -> str | None:
    """A column's name as we write it; None where it is none of ours."""
    figure = figure_of(name)
    if figure is not None:
        return figure
    match = _PART.fullmatch(name)
    channel = parse_channel(match["sensor"]) if match else None
    if match is None or channel is None:
        return None
    part = f"_{match['part'].lower()}" if match["part"] else ""
    return f"{channel.name}{part}"


def figure_of(title: str) -> str | None:
    """Which figure of a mode a title names, as programs of identification write it.

    `Std. Frequency`, `Damping Ratio`, `Fn`; None of any other title.
    """
    plain = re.sub(r"[\s_.\-]+", "", title).lower()
    return next((name for name, pattern in _TITLES.items() if re.fullmatch(pattern, plain)), None)


def _factor(table: Table, name: str, position: int) -> float:
    unit = table.units[position]
    if not unit:
        return 1.0
    if name in (DAMPING, DAMPING_SD) and unit == "%":
        return 0.01
    if name in (FREQUENCY, FREQUENCY_SD):
        return si_factor(table.file, unit, "frequency")
    if name == MODE or unit in ("-", "1"):
        return 1.0
    raise table.file.error(
        f"the column cannot be in {unit!r}; damping is a ratio or in %, a shape has no unit",
        column=table.title(position),
    )


def _shapes(
    table: Table, values: Mapping[str, Floats]
) -> tuple[tuple[str, ...], NDArray[np.inexact], Floats]:
    """Names of the sensors, shapes (r, s) and standard deviations (r, s)."""
    parts = [name for name in values if name not in _NAMED]
    sensors = tuple(dict.fromkeys(re.sub(r"_(re|im|sd)$", "", name) for name in parts))
    rows = len(table.values)
    shape, sd = np.zeros((rows, len(sensors)), dtype=complex), np.full((rows, len(sensors)), np.nan)
    for k, sensor in enumerate(sensors):
        what = f"the shape at {sensor}"
        real, imaginary = whole_or_parts(table.file, sensor, values, what)
        shape[:, k] = real if imaginary is None else real + 1j * imaginary
        sd[:, k] = values.get(f"{sensor}_sd", sd[:, k])
    real_only = not any(f"{sensor}_im" in values for sensor in sensors)
    return sensors, shape.real if real_only else shape, sd


def _cell(values: Mapping[str, Floats], name: str, row: int) -> float | None:
    if name not in values or np.isnan(values[name][row]):
        return None
    return float(values[name][row])
