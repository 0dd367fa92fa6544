"""Tables of numbers in text: delimiter, header row, units row, and the cell that is wrong."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats, Integers
from femupdate.measurement.cells import (
    Row,
    cells_of,
    find_delimiter,
    in_seconds,
    is_number,
    split_complex,
)
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.quantity import FORCES, si_factor, split_unit
from femupdate.measurement.sampling import uniform_step
from femupdate.measurement.text import TextFile

_MOST_ABOVE, _LEAST_ROWS, _LEAST_COLUMNS = 60, 10, 2


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of finite numbers with their names and units.

    Attributes:
        file: where they come from.
        names: (c,) titles of the columns without their units, or None where there is no header.
        units: (c,) unit of each column, or None where the file does not say.
        values: (r, c) the numbers.
        lines: (r,) line number of each row.
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
    ) -> "Table":
        """Arrays (r,) as a table; one of complex numbers becomes two, `name_re` and `name_im`.

        Args:
            file: where they come from.
            columns: by their names.
            units: of those that have one.
        """
        parts = {
            f"{name}{part}": (name, values)
            for name, column in columns.items()
            for part, values in (
                (("_re", column.real), ("_im", column.imag))
                if np.iscomplexobj(column)
                else (("", column),)
            )
        }
        values = np.column_stack([own.astype(np.float64) for _, own in parts.values()])
        stated = tuple(units.get(name) or None for name, _ in parts.values())
        return Table(file, tuple(parts), stated, values, np.arange(len(values)) + 1)

    def title(self, column: int) -> str:
        """Return what messages call a column."""
        return column_title(self.names, column)

    def channels(
        self, at: int, fewest: int = 3, what: str = "record"
    ) -> dict[int, RecordedChannel]:
        """The columns as histories by their positions, but for that of the times.

        Args:
            at: position of the times.
            fewest, what: rows that there must be, and for what.

        Raises:
            MeasurementError: there are fewer rows, or the sampling is not uniform.
        """
        count, width = self.values.shape
        if count < fewest:
            raise self.file.error(
                f"{count} rows are too short for a {what}; give at least {fewest}",
                int(self.lines[-1]),
            )
        seconds = si_factor(self.file, self.units[at] or "s", "time")
        step = uniform_step(self.file, self.values[:, at] * seconds, self.lines, self.title(at))
        return {
            column: RecordedChannel(
                name=self.names[column] if self.names else str(column),
                values=self.values[:, column],
                time_step=step,
                unit=self.units[column],
                quantity="force" if self.units[column] in FORCES else "acceleration",
            )
            for column in range(width)
            if column != at
        }


def column_title(names: tuple[str, ...] | None, column: int) -> str:
    """Return a column's quoted name, or its number from 1 where it has none."""
    return repr(names[column]) if names else str(column + 1)


def read_table(file: TextFile) -> Table:
    """Read a table whose columns are parted by semicolons, tabs, commas or blanks.

    A column of complex numbers becomes two, `name_re` and `name_im`.
    Lines starting with # or % are skipped, and so is what a logger writes above the table. A first
    row whose first cell is not a number is the header; a second one without any number is the units
    row. Where the delimiter is not the comma, a comma in a number is the decimal sign. Dates and
    times of day in the first column become seconds.

    Raises:
        MeasurementError: a cell is blank, text or not finite, a row has another number of cells,
            or two columns have one name.
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
    return Table(file, names, units or (None,) * values.shape[1], values, lines)


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

    Raises:
        MeasurementError: there is no row, or a cell is blank, text or not finite, or a row has
            another number of cells than the first.
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

    Raises:
        MeasurementError: two columns have one name, or the units row has another width.
    """
    line, text = rows[0]
    if delimiter is None:  # "time (s) RF (g)": the unit stays with its name
        text = re.sub(r"\s+([(\[])", r"\1", text)
    first = cells_of(text, delimiter)
    if is_number(first[0]):
        return None, None, rows
    titles = [split(cell) for cell in first]
    names = tuple(name for name, _ in titles)
    _refuse_repeats(file, names, line)
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
    stated = tuple(own or beside for own, beside in zip(below, units, strict=True))
    return names, stated, rows[2:]


def _drop_blank_tail(text: str, delimiter: str, count: int) -> str:
    for _ in range(count):
        head, mark, tail = text.rpartition(delimiter)
        if not mark or tail.strip():
            break
        text = head
    return text


def _refuse_repeats(file: TextFile, names: tuple[str, ...], line: int) -> None:
    for position, name in enumerate(names):
        if name and name in names[:position]:
            raise file.error(
                f"two columns are called {name!r}; rename or remove one (several sensors of a"
                f" floor are {name}:1, {name}:2)",
                line,
            )


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
