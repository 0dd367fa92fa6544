"""Tables of numbers in text: cells, header, units, and the cell that is wrong."""

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats, Integers
from femupdate.measurement.clock import is_moment, seconds_of
from femupdate.measurement.names import (
    FREQUENCY,
    FREQUENCY_NAME,
    TIME,
    TIME_NAME,
    FloorChannel,
    FrfColumn,
    bracketed,
    force_unit,
    si_factor,
    split_unit,
)
from femupdate.measurement.text import TextFile

Row = tuple[int, str]  # line number, text


def find_delimiter(line: str) -> str | None:
    """Return the delimiter of a row; None stands for blanks."""
    # The semicolon comes first: beside it a comma can only be the decimal sign.
    return next((mark for mark in ";\t,|" if mark in line), None)


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Split a row into its cells, without blanks and quotes around them."""
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


# Cells without a value, as people and programs write them; and what only Fortran writes.
BLANKS = ("", "-", "--", "–", "nan", "n/a", "#n/a", "na", "null", "none")
_FORTRAN = r"(?<=[\d.])[dD](?=[-+]?\d)"
_COUNTER = re.compile(r"#|no|nr|num(ber)?|idx|index|samples?|row|point|pt|scan|count(er)?|", re.I)


def is_number(cell: str) -> bool:
    """Return whether a cell reads as a number (nan and inf included)."""
    try:
        float(re.sub(_FORTRAN, "e", cell).replace(",", "."))
    except ValueError:
        return False
    return True


_THOUSANDS = r"[-+]?[1-9]\d{0,2}(,\d{3})+"


def unquoted(rows: list[Row]) -> list[Row]:
    """Rows without quotes, and without commas that part thousands or are decimal signs in them."""
    delimiter = find_delimiter(re.sub(r'"[^"]*"', "", rows[-1][1]))
    if delimiter is None or not any('"' in text for _, text in (rows[0], rows[-1])):
        return rows
    table = list(csv.reader([text for _, text in rows], delimiter=delimiter, skipinitialspace=True))
    numbers = [
        cell for cells in table for cell in cells if re.fullmatch(r"[-+\d.,eE]*,[\d.]+", cell)
    ]
    thousands = any("." in cell or cell.count(",") > 1 for cell in numbers) or all(
        re.fullmatch(_THOUSANDS, cell) for cell in numbers
    )
    for cells in table:
        for k, cell in enumerate(cells):
            if "," in cell and is_number(cell.replace(",", "")):
                cells[k] = cell.replace(",", "" if thousands else ".")
            elif delimiter in cell:
                cells[k] = cell.replace(delimiter, " ")
    if len(table) != len(rows):  # a quote that nothing closes
        return rows
    return [(line, delimiter.join(cells)) for (line, _), cells in zip(rows, table, strict=True)]


_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?"
_COMPLEX = re.compile(
    rf"\(?\s*(?:(?P<re>{_NUMBER})\s*(?=[-+]))?(?P<im>[-+]?\s*{_NUMBER})\s*\*?\s*[ij]\s*\)?",
    re.IGNORECASE,
)


def split_complex(rows: Sequence[Row]) -> list[Row]:
    """Rows with every column of complex numbers as two, `name_re` and `name_im`.

    The first row names the columns, else they are named by numbers, and the first is the
    frequency; without complex cells the rows come back as they are.
    """

    def complex_in(cell: str) -> re.Match[str] | None:
        # The pattern takes very long to refuse a long cell.
        return _COMPLEX.fullmatch(cell) if len(cell) <= 80 else None

    delimiter = find_delimiter(rows[0][1])
    titles = cells_of(rows[0][1], delimiter)
    complex_columns = {
        k
        for _, text in rows[-40:]
        for k, cell in enumerate(cells_of(text, delimiter))
        if complex_in(cell)
    }
    complex_columns -= {k for k in complex_columns if k >= len(titles)}
    if not complex_columns:
        return list(rows)
    mark = delimiter or " "
    if is_number(titles[0]):
        titles = [FREQUENCY, *(str(k + 2) for k in range(len(titles) - 1))]
        rows = [(rows[0][0], mark.join(titles)), *rows]

    split = []
    for row, (line, text) in enumerate(rows):
        cells = []
        for k, cell in enumerate(cells_of(text, delimiter)):
            match = complex_in(cell) if k in complex_columns else None
            if k not in complex_columns:
                cells.append(cell)
            elif row == 0:  # a unit in brackets stays behind the name
                name, bracket, unit = cell.partition("(" if "(" in cell else "[")
                behind = f" {bracket}{unit}" if bracket else ""
                cells += [f"{name.strip()}_{part}{behind}" for part in ("re", "im")]
            elif match is not None:
                cells += [match["re"] or "0", re.sub(r"\s", "", match["im"])]
            else:
                cells += [cell, cell if cell.lower() in BLANKS else "0"]
        split.append((line, mark.join(cells)))
    return split


MOMENT_CELLS = ((0, 1), (0, 2), (1, 2), (1, 3))  # first, and behind the last


def in_seconds(file: TextFile, rows: list[Row], delimiter: str | None) -> list[Row]:
    """Rows with seconds since the first in a column whose cells are moments, as `time_s`.

    A date and a time of day may stand in two cells, and one cell before them, such as a number.
    """
    # As in nearly all tables there is none, two rows alone are looked at.
    last, some = (cells_of(rows[k][1], delimiter) for k in (-1, len(rows) // 2))
    at = [(a, b) for row in (last, some) for a, b in MOMENT_CELLS if is_moment(" ".join(row[a:b]))]
    if not at:
        return rows
    first, behind = at[0]

    def moment(cells: Sequence[str]) -> str:
        return " ".join(cells[first:behind])

    table = [cells_of(text, delimiter) for _, text in rows]
    start = next(k for k, cells in enumerate(table) if is_moment(moment(cells)))
    start -= start > 1 and any(map(is_number, table[start - 1][behind:]))  # values without a time
    seconds = seconds_of([moment(cells) for cells in table[start:]])
    if isinstance(seconds, int):
        cell = moment(table[start + seconds])
        what = f"{cell!r} is not a time of any day" if cell.strip() else "the time is blank"
        title = column_title(tuple(table[0]) if start else None, first)
        raise file.error(f"{what}; correct it, or remove the row", rows[start + seconds][0], title)
    leads = [TIME, *["s"] * (start - 1)][:start] + [f"{value:.9f}" for value in seconds]
    made = []
    for (line, _), lead, cells in zip(rows, leads, table, strict=True):
        rest = behind - (behind > first + 1 and len(cells) < len(last))
        made.append((line, (delimiter or " ").join([*cells[:first], lead, *cells[rest:]])))
    return made


_MOST_ABOVE, _LEAST_ROWS, _LEAST_COLUMNS = 60, 10, 2


@dataclass(frozen=True, eq=False)
class ColumnTable:
    """Columns of finite numbers with their names and units.

    Attributes:
        names: (c,) titles of the columns without their units, or None where there is no header.
        units: (c,) unit of each column, or None where the file does not say.
        values: (r, c) the numbers, NaN where a cell is blank.
        at: position of the column that the others go by.
        axis: our name of that, times or frequencies; empty until it is known (`resolved`).
        known: what each other column stands for, by its position.
    """

    file: TextFile
    names: tuple[str, ...] | None
    units: tuple[str | None, ...]
    values: Floats
    lines: Integers
    at: int = 0
    axis: str = ""
    known: Mapping[int, FloorChannel | FrfColumn] = field(default_factory=dict)

    @property
    def frfs(self) -> dict[FrfColumn, int]:
        """Position of every column of response functions."""
        return {column: i for i, column in self.known.items() if isinstance(column, FrfColumn)}

    @property
    def frequency_hz(self) -> Floats:
        """(r,) of the rows."""
        named = FREQUENCY_NAME.match((self.names or ("",))[self.at])
        unit = self.units[self.at] or ("rad/s" if named and named["w"] else "Hz")
        frequency = self.values[:, self.at] * si_factor(self.file, unit, "frequency")
        wrong = np.flatnonzero(~((np.diff(frequency, prepend=-1.0) > 0) & (frequency >= 0)))
        if wrong.size:
            raise self.file.error(
                "the frequencies must be zero or above and increase; sort the rows by frequency",
                int(self.lines[wrong[0]]),
                FREQUENCY,
            )
        return frequency

    @property
    def force_units(self) -> list[str]:
        """Units of columns that only a response to a force has."""
        units = (self.units[i] for column, i in self.frfs.items() if column.part != "sd")
        return [unit for unit in units if unit and force_unit(unit)]

    @staticmethod
    def of_arrays(
        file: TextFile, columns: Mapping[str, NDArray[np.number]], units: Mapping[str, str | None]
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

    def with_times(self, columns: Mapping[str, str]) -> "tuple[ColumnTable, Mapping[str, str]]":
        """The table with numbers for names that it lacks, and times by a rate such as `200 Hz`.

        Args:
            columns: our column name to the file's, or `time_s` to a rate; returned without that.
        """
        names = self.names
        if names is None and columns:
            names = tuple(str(k + 1) for k in range(self.values.shape[1]))
        said = columns.get(TIME, "")
        rate = re.fullmatch(r"(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?|nan|-?inf)\s*Hz", said, re.IGNORECASE)
        if rate is None and said and TIME in (names or ()) and said not in (names or ()):
            raise self.file.error(f"its times are {TIME} already; leave {TIME}={said} out")
        if rate is None or names is None:
            return replace(self, names=names), columns
        if TIME in names:
            raise self.file.error(f"the file has times; leave out the rate of {rate[0]}")
        if not 0.0 < float(rate[1]) < np.inf:
            raise self.file.error(f"{TIME}={rate[0]} is no rate; give the samples a second")
        times = np.arange(len(self.values)) / float(rate[1])
        timed = replace(
            self,
            names=(*names, TIME),
            units=(*self.units, "s"),
            values=np.column_stack([self.values, times]),
        )
        return timed, {ours: theirs for ours, theirs in columns.items() if ours != TIME}

    def require_filled(self, columns: Sequence[int]) -> None:
        """Refuse blank cells in some columns."""
        blank = np.argwhere(np.isnan(self.values[:, list(columns)]))
        if blank.size:
            row, column = blank[0]
            raise self.file.error(
                f"the cell is blank or nan ({len(blank)} in all); fill in the measured value, or "
                "remove row or column",
                int(self.lines[row]),
                self.title(columns[column]),
            )

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
    rows = in_seconds(file, rows, delimiter)
    rows = drop_trailing_blanks(rows, delimiter)
    names, units, data = read_head_rows(file, rows, delimiter)
    values, lines = parse_rows(file, data, delimiter, names, blanks=True)
    units = units or (None,) * values.shape[1]
    if names and _COUNTER.fullmatch(names[0]) and (np.diff(values[:, 0]) == 1.0).all():
        names, units, values = names[1:], units[1:], values[:, 1:]  # numbers of the rows
    if names and "" in names:
        nameless = f"column {names.index('') + 1} has no name"
        raise file.error(f"{nameless}; give every column one or remove it", rows[0][0])
    return ColumnTable(file, names, units, values, lines)


_DECIBEL = re.compile(r"dB\b\s*(?:ref?\.?:?\s*)?(?:1\s+)?(?P<unit>.*)", re.IGNORECASE)
_PHASE = re.compile(r"(?<![^\W_])(phase|phase angle|angle|arg)(?![^\W_])|[φ∠]", re.IGNORECASE)
_SIZE = re.compile(
    r"(?<![^\W_])(mag(nitude)?|amp(l(itude)?)?|abs|modulus|db)(?![^\W_])|\|", re.IGNORECASE
)
_DEGREES = ("deg", "degrees", "°")


def without_decibels(table: ColumnTable) -> ColumnTable:
    """Functions of frequency whose levels in dB are ratios, and those with a phase complex.

    Raises:
        MeasurementError: a phase has no unit, or no magnitude beside it.
    """
    if not (table.names and FREQUENCY_NAME.match(table.names[0])):
        return table
    values, names, units = table.values.copy(), list(table.names), list(table.units)
    sizes, phases = {}, {}
    for k, title in enumerate(names):
        name, inside = bracketed(title)
        unit = units[k] or inside or ""
        decibel, phase = _DECIBEL.fullmatch(unit), _PHASE.search(name)
        key = " ".join(re.sub(r"[_\s]+", " ", (_PHASE if phase else _SIZE).sub(" ", name)).split())
        if phase:
            if unit.lower() not in (*_DEGREES, "rad"):
                raise table.file.error(
                    f"the phase is in {unit or 'no unit'}; write (deg) or (rad) behind its name",
                    column=table.title(k),
                )
            phases[key] = k, np.pi / 180.0 if unit.lower() in _DEGREES else 1.0
        elif decibel or re.search(r"(?<![^\W_])db$", name, re.IGNORECASE):
            # A standard deviation in dB is one of ln|H|.
            spread = key.lower().endswith(" sd")
            ratio = np.log(10.0) / 20.0
            values[:, k] = values[:, k] * ratio if spread else np.exp(values[:, k] * ratio)
            names[k] = f"{key[:-3]}_sd" if spread else key
            units[k] = (decibel and decibel["unit"].strip("() ")) or None
            sizes[key] = k
        elif k:
            sizes[key] = k
    for key, (at, factor) in phases.items():
        if key not in sizes:
            raise table.file.error(
                f"there is no magnitude of {key!r} beside its phase; name both alike, such as"
                " 2F_mag and 2F_phase (deg)",
                column=table.title(at),
            )
        size, angle = values[:, sizes[key]], values[:, at] * factor
        values[:, sizes[key]], values[:, at] = size * np.cos(angle), size * np.sin(angle)
        names[sizes[key]], names[at] = f"{key}_re", f"{key}_im"
        units[at] = units[sizes[key]]
    return replace(table, names=tuple(names), units=tuple(units), values=values)


def rows_of_table(file: TextFile) -> list[Row]:
    """Rows of a table without what loggers write above it: lines of other numbers of cells."""
    rows = unquoted(file.rows())
    delimiter = find_delimiter(rows[-1][1])
    last, titles = (cells_of(rows[k][1], delimiter) for k in (-1, 0))
    width = len(last)
    if len(titles) == width or width < _LEAST_COLUMNS:
        # Spreadsheets pad titles above a table to its width.
        padded = (cells_of(text, delimiter) for _, text in rows[:_MOST_ABOVE])
        reach = _filled(last)
        full = ((k, cells) for k, cells in enumerate(padded) if _filled(cells) >= reach)
        first, header = next(full, (0, titles))
        return rows if is_number(header[reach - 1]) else rows[first:]
    if delimiter == "," and width in (2 * len(titles) - 1, 2 * len(titles)) and len(titles) > 1:
        raise file.error(
            f"the row has {width} cells where {len(titles)} are expected: commas stand between"
            " cells and in numbers; export the table with semicolons",
            rows[-1][0],
        )
    other = [
        k
        for k, (_, text) in enumerate(rows[:_MOST_ABOVE])
        if len(cells_of(text, delimiter)) != width
    ]
    first = other[-1] + 1
    whole = first < min(_MOST_ABOVE, len(rows) - _LEAST_ROWS)
    return rows[first:] if whole else rows


def _filled(cells: Sequence[str]) -> int:
    """Number of cells up to the last that is not blank."""
    return max((position for position, cell in enumerate(cells, start=1) if cell), default=0)


def drop_trailing_blanks(rows: list[Row], delimiter: str | None) -> list[Row]:
    """Drop from all rows the blank cells that end the first one, as spreadsheets leave them."""
    if delimiter is None:
        return rows
    first = cells_of(rows[0][1], delimiter)
    filled = _filled(first)
    blank = len(first) - filled
    if blank == 0 or filled == 0:
        return rows
    cut = []
    for line, text in rows:
        for _ in range(blank):
            head, mark, tail = text.rpartition(delimiter)
            if not mark or tail.strip():
                break
            text = head
        cut.append((line, text))
    return cut


def whole_row(file: TextFile, line: int, text: str, delimiter: str | None, width: int) -> list[str]:
    """The cells of a row, which must be so many."""
    cells = cells_of(text, delimiter)
    if len(cells) != width:
        raise file.error(
            f"the row has {len(cells)} cells where {width} are expected; the file may be cut off:"
            " complete or remove the row",
            line,
        )
    return cells


def parse_rows(
    file: TextFile,
    rows: list[Row],
    delimiter: str | None,
    names: tuple[str, ...] | None,
    blanks: bool = False,
) -> tuple[Floats, Integers]:
    """Return the values (r, c) of numeric rows and their line numbers (r,).

    Args:
        blanks: a cell may be blank or say so, which gives NaN.
    """
    if not rows:
        raise file.error("the file has a header but no data; write it again from its source")
    texts = [text for _, text in rows]
    if re.search(_FORTRAN, texts[-1]):
        texts = [re.sub(_FORTRAN, "e", text) for text in texts]
    if delimiter != ",":
        if any(re.search(r"\d,\d{3}\.", text) for text in texts):  # 1,234.5
            texts = [text.replace(",", "") for text in texts]
        elif any(re.search(r"\d\.\d{3},", text) for text in texts):  # 1.234,5
            texts = [text.replace(".", "") for text in texts]
        texts = [text.replace(",", ".") for text in texts]
    width = len(names) if names else len(cells_of(texts[0], delimiter))
    lines = np.array([number for number, _ in rows])
    try:
        values = np.loadtxt(texts, delimiter=delimiter, comments=None, ndmin=2, quotechar='"')
    except ValueError:
        values = None
    refused = np.isinf if blanks else lambda found: ~np.isfinite(found)
    if values is not None and values.shape[1] == width and not refused(values).any():
        return values, lines
    for line, text in zip(lines.tolist(), texts, strict=True):
        cells = whole_row(file, line, text, delimiter, width)
        for position, cell in enumerate(cells):
            number = is_number(cell)
            if (number and not refused(float(cell))) or (blanks and cell.lower() in BLANKS):
                continue
            what = f"{cell!r} is not a number" if cell else "the cell is blank"
            cure = "fill in the measured value or remove the row or column"
            if position == 0 and (":" in cell or cell[:8].isdigit()):
                cure = "write times as 2024-03-05 10:00:00.005, or in seconds"
            elif position == 0 and names and cell.startswith(names[0] or cell):
                cure = (
                    "the header comes again, as where a logger starts anew: remove it where the"
                    " times go on, else make each part a file"
                )
            elif position == 0 and all(map(is_number, cells[1:])):
                cure = "if channels are rows here, turn the table: a column for each"
            raise file.error(
                f"{f'the value is {cell}' if number else what}; {cure}",
                line,
                column_title(names, position),
            )
    if not blanks:
        raise file.error("the table cannot be read as numbers; write plain decimal numbers")
    table = [cells_of(text, delimiter) for text in texts]
    filled = [["nan" if cell.lower() in BLANKS else cell for cell in row] for row in table]
    return np.array(filled, dtype=np.float64), lines


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
            cure = f"rename or remove one (several sensors of a floor are {name}:1, {name}:2)"
            if TIME_NAME.match(name):
                cure = "keep one where both are alike, else give each clock a file"
            raise file.error(f"two columns are called {name!r}; {cure}", line)
    units: tuple[str | None, ...] = tuple(unit for _, unit in titles)
    for kind, named in (("time", TIME_NAME), ("frequency", FREQUENCY_NAME)):
        name, inside = bracketed(first[0])
        if inside and units[0] is None and named.match(name):
            si_factor(file, inside, kind, first[0])  # refuses what is no unit
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
