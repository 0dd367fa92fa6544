"""Tables of numbers in text: cells, header, units, time step, and the cell that is wrong."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats, Integers
from femupdate.measurement.names import TIME
from femupdate.measurement.quantity import split_unit
from femupdate.measurement.text import TextFile

# Figures by which files are judged.
_DECIMALS = 9  # of times that are looked at, at most

Row = tuple[int, str]  # line number, text


def find_delimiter(line: str) -> str | None:
    """Return the delimiter of a row; None stands for blanks."""
    # The semicolon comes first: beside it a comma can only be the decimal sign.
    return next((mark for mark in ";\t," if mark in line), None)


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Split a row into its cells, without blanks and quotes around them."""
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def is_number(cell: str) -> bool:
    """Return whether a cell reads as a number (nan and inf included)."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?"
_COMPLEX = re.compile(
    rf"\(?\s*(?:(?P<re>{_NUMBER})\s*(?=[-+]))?(?P<im>[-+]?\s*{_NUMBER})\s*\*?\s*[ij]\s*\)?",
    re.IGNORECASE,
)
_ENOUGH = 40


def split_complex(rows: Sequence[Row], blanks: Sequence[str] = ()) -> list[Row]:
    """Rows with every column of complex numbers as two, `name_re` and `name_im`.

    The first row names the columns; without complex cells the rows come back as they are.

    Args:
        blanks: cells that stand for a missing value.
    """
    delimiter = find_delimiter(rows[0][1])
    titles = cells_of(rows[0][1], delimiter)
    complex_columns = {
        k
        for _, text in rows[1:_ENOUGH]
        for k, cell in enumerate(cells_of(text, delimiter))
        if _complex(cell)
    }
    complex_columns -= {k for k in complex_columns if k >= len(titles)}
    if not complex_columns or is_number(titles[0]):
        return list(rows)
    mark = delimiter or " "

    split = []
    for row, (line, text) in enumerate(rows):
        cells = []
        for k, cell in enumerate(cells_of(text, delimiter)):
            match = _complex(cell) if k in complex_columns else None
            if k not in complex_columns:
                cells.append(cell)
            elif row == 0:  # a unit in brackets stays behind the name
                name, bracket, unit = cell.partition("(" if "(" in cell else "[")
                behind = f" {bracket}{unit}" if bracket else ""
                cells += [f"{name.strip()}_{part}{behind}" for part in ("re", "im")]
            elif match is not None:
                cells += [match["re"] or "0", re.sub(r"\s", "", match["im"])]
            else:
                cells += [cell, cell if cell.lower() in blanks else "0"]
        split.append((line, mark.join(cells)))
    return split


def _complex(cell: str) -> re.Match[str] | None:
    # The pattern takes very long to refuse a long cell.
    return _COMPLEX.fullmatch(cell) if len(cell) <= 80 else None


# 2020-01-31 12:00:00.005, also with T and Z, or 12:00:00.005 alone.
_MOMENT = re.compile(
    r"(?P<date>\d{4}[-/]\d\d[-/]\d\d)?[T ]?(?P<time>\d\d:\d\d:\d\d(?:[.,]\d{1,9})?)Z?"
)


def in_seconds(rows: list[Row], delimiter: str | None) -> list[Row]:
    """Rows whose first cells are times in seconds since the first, where all are moments.

    Their column is called `time_s`.
    """
    if not _MOMENT.fullmatch(cells_of(rows[-1][1], delimiter)[0]):
        return rows  # as nearly all tables: not a row more need be looked at
    first = [cells_of(text, delimiter)[0] for _, text in rows]
    matches = [_MOMENT.fullmatch(cell) for cell in first]
    start = next((k for k, match in enumerate(matches) if match), len(rows))
    plain = all(text.strip().startswith(cell) for (_, text), cell in zip(rows, first, strict=True))
    if start == len(rows) or not all(matches[start:]) or not plain:
        return rows
    moments = np.array(
        [
            f"{(match['date'] or '2000-01-01').replace('/', '-')}T{match['time'].replace(',', '.')}"
            for match in matches[start:]
            if match
        ],
        dtype="datetime64[ns]",
    )
    seconds = (moments - moments[0]) / np.timedelta64(1, "s")
    comma = "," if delimiter != "," else "."
    timed = [
        (line, f"{value:.9f}".replace(".", comma) + text.strip()[len(cell) :])
        for (line, text), cell, value in zip(rows[start:], first[start:], seconds, strict=True)
    ]
    head = [(line, TIME + text.strip()[len(first[0]) :]) for line, text in rows[: min(start, 1)]]
    return [*head, *rows[1:start], *timed]


def check_step(file: TextFile, step: float, title: str | None = None) -> None:
    """Refuse a time step with which no building is measured."""
    # An impact on a model has steps of 1e-6 s, the slowest monitoring of a tower 10 s.
    shortest, longest = 1e-6, 10.0
    if not shortest <= step <= longest:
        raise file.error(
            f"the time step is {step:.3g} s, and buildings are measured every {shortest:g} to"
            f" {longest:g} s; is the time's unit wrong?",
            column=title,
        )


def uniform_step(file: TextFile, time: Floats, lines: Integers, title: str) -> float:
    """Return the time step of uniformly sampled times, s.

    Printed times are rounded: a time may differ from the straight line through all of them by
    three quarters of its last printed digit, or by a hundredth of a step, whichever is larger.

    Args:
        time: (n,) at least three times, s.
    """
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if backwards.size and np.mean(np.diff(time) <= 0) > 0.5:
        raise file.error("the times do not increase; sort the rows by time", None, title)
    check_step(file, float(np.median(np.diff(time))), title)
    digit = 10.0 ** -_decimals(time)
    time = time - time[0]
    step, start = np.polyfit(np.arange(time.size), time, 1)
    # A hundredth of a step turns the phase at half the Nyquist frequency by less than a degree;
    # a lost sample shifts all times by half a step.
    tolerance = min(max(0.75 * digit, 0.01 * step), 0.3 * step)
    deviation = np.abs(time - (start + step * np.arange(time.size)))
    if backwards.size or deviation.max() > tolerance:
        steps = np.diff(time)
        usual = float(np.median(steps))
        worst = int(np.argmax(np.abs(steps - usual)))
        raise file.error(
            f"the sampling is not uniform: {steps[worst]:.6g} s after the row before, elsewhere"
            f" {usual:.6g} s; fill the gap or resample to one time step",
            int(lines[worst + 1]),
            title,
        )
    # The nearest whole sampling rate or round step that the first and last time's digits allow.
    allowed = digit / (time.size - 1)
    rate, rounded = round(1.0 / step), round(step, _DECIMALS)
    if rate > 0 and abs(step - 1.0 / rate) <= allowed:
        return 1.0 / rate
    return rounded if abs(step - rounded) <= allowed else float(step)


def _decimals(time: Floats) -> int:
    """Number of decimals that the times are printed with."""
    scale = np.abs(time).max() * 1e-14
    for decimals in range(_DECIMALS):
        if np.abs(np.round(time, decimals) - time).max() <= scale:
            return decimals
    return _DECIMALS


_MOST_ABOVE, _LEAST_ROWS, _LEAST_COLUMNS = 60, 10, 2


@dataclass(frozen=True, eq=False)
class ColumnTable:
    """Columns of finite numbers with their names and units.

    Attributes:
        names: (c,) titles of the columns without their units, or None where there is no header.
        units: (c,) unit of each column, or None where the file does not say.
        values: (r, c) the numbers.
    """

    file: TextFile
    names: tuple[str, ...] | None
    units: tuple[str | None, ...]
    values: Floats
    lines: Integers

    @staticmethod
    def of_arrays(
        file: TextFile,
        columns: Mapping[str, NDArray[np.number]],
        units: Mapping[str, str | None],
    ) -> "ColumnTable":
        """Arrays (r,) as a table; one of complex numbers becomes two, `name_re` and `name_im`."""
        parts = {
            f"{name}{part}": (name, values)
            for name, column in columns.items()
            for part, values in (
                (("_re", column.real), ("_im", column.imag))
                if np.iscomplexobj(column)
                else (("", column),)
            )
        }
        values = np.column_stack([column.astype(np.float64) for _, column in parts.values()])
        stated = tuple(units.get(name) or None for name, _ in parts.values())
        return ColumnTable(file, tuple(parts), stated, values, np.arange(len(values)) + 1)

    def title(self, column: int) -> str:
        """Return what messages call a column."""
        return column_title(self.names, column)


def column_title(names: tuple[str, ...] | None, column: int) -> str:
    """Return a column's quoted name, or its number from 1 where it has none."""
    return repr(names[column]) if names else str(column + 1)


def read_table(file: TextFile) -> ColumnTable:
    """Read a table whose columns are parted by semicolons, tabs, commas or blanks.

    A column of complex numbers becomes two, `name_re` and `name_im`.
    Lines starting with # or % are skipped, and so is what a logger writes above the table. A first
    row whose first cell is not a number is the header; a second one without any number is the units
    row. Where the delimiter is not the comma, a comma in a number is the decimal sign. Dates and
    times of day in the first column become seconds.
    """
    rows = split_complex(rows_of_table(file))
    delimiter = find_delimiter(rows[0][1])
    rows = in_seconds(rows, delimiter)
    rows = drop_trailing_blanks(rows, delimiter)
    names, units, data = read_head_rows(file, rows, delimiter)
    for position, name in enumerate(names or ()):
        if not name:
            raise file.error(
                f"column {position + 1} has no name; give every column one or remove it", rows[0][0]
            )
    values, lines = parse_rows(file, data, delimiter, names)
    return ColumnTable(file, names, units or (None,) * values.shape[1], values, lines)


def rows_of_table(file: TextFile) -> list[Row]:
    """Rows of a table without what loggers write above it: lines of other numbers of cells."""
    rows = file.rows()
    delimiter = find_delimiter(rows[-1][1])
    width = len(cells_of(rows[-1][1], delimiter))
    if len(cells_of(rows[0][1], delimiter)) == width or width < _LEAST_COLUMNS:
        return rows
    other = [
        k
        for k, (_, text) in enumerate(rows[:_MOST_ABOVE])
        if len(cells_of(text, delimiter)) != width
    ]
    first = other[-1] + 1
    whole = first < min(_MOST_ABOVE, len(rows) - _LEAST_ROWS)
    return rows[first:] if whole else rows


def drop_trailing_blanks(rows: list[Row], delimiter: str | None) -> list[Row]:
    """Drop from all rows the blank cells that end the first one, as spreadsheets leave them."""
    if delimiter is None:
        return rows
    first = cells_of(rows[0][1], delimiter)
    filled = max((position for position, cell in enumerate(first, start=1) if cell), default=0)
    blank = len(first) - filled
    if blank == 0 or filled == 0:
        return rows
    return [(line, _drop_blank_tail(text, delimiter, blank)) for line, text in rows]


def parse_rows(
    file: TextFile,
    rows: list[Row],
    delimiter: str | None,
    names: tuple[str, ...] | None,
    missing: bool = False,
) -> tuple[Floats, Integers]:
    """Return the values (r, c) of numeric rows and their line numbers (r,).

    Args:
        missing: a cell may be `nan`.
    """
    if not rows:
        raise file.error("the file has a header but no data; write it again from its source")
    texts = [text for _, text in rows]
    if delimiter != ",":
        texts = [text.replace(",", ".") for text in texts]
    width = len(names) if names else len(cells_of(texts[0], delimiter))
    lines = np.array([number for number, _ in rows])
    try:
        values = np.loadtxt(texts, delimiter=delimiter, comments=None, ndmin=2, quotechar='"')
    except ValueError:
        values = None
    refused = np.isinf if missing else lambda found: ~np.isfinite(found)
    if values is None or values.shape[1] != width or refused(values).any():
        _blame(
            file, list(zip(lines.tolist(), texts, strict=True)), delimiter, width, names, refused
        )
        raise file.error("the table cannot be read as numbers; write plain decimal numbers")
    return values, lines


def read_head_rows(
    file: TextFile,
    rows: list[Row],
    delimiter: str | None,
    split: Callable[[str], tuple[str, str | None]] = split_unit,
) -> tuple[tuple[str, ...] | None, tuple[str | None, ...] | None, list[Row]]:
    """Names and units of the columns, None where the first row has numbers, and the other rows.

    Args:
        split: a title into name and unit.
    """
    line, text = rows[0]
    if delimiter is None:  # "time (s) RF (g)": the unit stays with its name
        text = re.sub(r"\s+([(\[])", r"\1", text)
    first = cells_of(text, delimiter)
    if is_number(first[0]):
        return None, None, rows
    titles = [split(cell) for cell in first]
    names = tuple(name for name, _ in titles)
    for position, name in enumerate(names):
        if name and name in names[:position]:
            raise file.error(
                f"two columns are called {name!r}; rename or remove one (several sensors of a"
                f" floor are {name}:1, {name}:2)",
                line,
            )
    units: tuple[str | None, ...] = tuple(unit for _, unit in titles)
    second = cells_of(rows[1][1], delimiter) if len(rows) > 1 else ["0"]
    if any(is_number(cell) for cell in second):
        return names, units, rows[1:]
    if len(second) != len(names):
        raise file.error(
            f"the units row has {len(second)} cells but the header has {len(names)};"
            " give every column a unit",
            rows[1][0],
        )
    below = [None if unit in ("", "-") else unit for unit in second]
    stated = tuple(unit or beside for unit, beside in zip(below, units, strict=True))
    return names, stated, rows[2:]


def _drop_blank_tail(text: str, delimiter: str, count: int) -> str:
    for _ in range(count):
        head, mark, tail = text.rpartition(delimiter)
        if not mark or tail.strip():
            break
        text = head
    return text


def _blame(
    file: TextFile,
    rows: list[Row],
    delimiter: str | None,
    width: int,
    names: tuple[str, ...] | None,
    refused: Callable[[Any], Any],
) -> None:
    """Raise the error of the first cell that is no number or a refused one."""
    for line, text in rows:
        cells = cells_of(text, delimiter)
        if len(cells) != width:
            raise file.error(
                f"the row has {len(cells)} cells where {width} are expected; the file may be cut"
                " off: complete or remove the row",
                line,
            )
        for position, cell in enumerate(cells):
            if is_number(cell) and not refused(float(cell.replace(",", "."))):
                continue
            what = f"{cell!r} is not a number" if cell else "the cell is blank"
            if is_number(cell):
                what = f"the value is {cell}"
            raise file.error(
                f"{what}; fill in the measured value or remove the row or column",
                line,
                column_title(names, position),
            )
