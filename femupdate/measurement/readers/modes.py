"""Tables of identified modes in text: a column of frequencies, cells may be blank."""

import re
from pathlib import Path

import numpy as np

from femupdate.measurement.cells import Row, cells_of, find_delimiter, is_number
from femupdate.measurement.columns import FREQUENCY
from femupdate.measurement.complex_text import split_complex
from femupdate.measurement.mode_table import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE, figure_of
from femupdate.measurement.quantity import bracketed
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile, read_text

# Columns that no table of histories or of response functions has.
_TELLING = (MODE, FREQUENCY_SD, DAMPING, DAMPING_SD)
_BLANK = ("", "-", "–", "nan", "n/a", "na", "none")
_LEAST_TOLD, _MOST_ABOVE = 2, 10


def _recognises(head: str, suffix: str) -> bool:
    """Whether a row above the numbers names columns that only identified modes have."""
    if "\0" in head:
        return False
    return _header_at(TextFile(Path(), tuple(head.split("\n"))).rows()) is not None


def _header_at(rows: list[Row]) -> int | None:
    """Index of the row that names the columns: the first one, or below what programs write above.

    Below the first row, it must name the frequencies too.
    """
    for index, (_, text) in enumerate(rows[:_MOST_ABOVE]):
        figures = [figure_of(bracketed(cell)[0]) for cell in cells_of(text, find_delimiter(text))]
        telling = any(figure in _TELLING for figure in figures) and len(figures) >= _LEAST_TOLD
        if telling and (index == 0 or FREQUENCY in figures):
            return index
    return None


def _read(path: Path) -> Recording:
    """A table whose cells may be blank.

    Raises:
        MeasurementError: a row has another number of cells, or a cell is text.
    """
    file = read_text(path)
    rows = file.rows()
    above = _header_at(rows) or 0
    rows = split_complex(rows[above:], _BLANK)
    delimiter = find_delimiter(rows[0][1])
    titles = [bracketed(cell) for cell in cells_of(rows[0][1], delimiter)]
    names = tuple(name for name, _ in titles)
    repeated = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if repeated is not None:
        raise file.error(f"two columns are called {repeated!r}; rename or remove one", rows[0][0])
    second = cells_of(rows[1][1], delimiter) if len(rows) > 1 else []
    if second and not any(map(is_number, second)):
        titles = [(name, unit or None) for name, unit in zip(names, second, strict=False)]
        del rows[1]
    if len(rows) == 1:
        raise file.error("the file has a header but no modes; give one row for each")
    values = [_row(file, names, line, text, delimiter) for line, text in rows[1:]]
    lines = np.array([line for line, _ in rows[1:]])
    units = tuple(unit for _, unit in titles)
    notes = (f"Lines above the table that are passed over: {above}.",) if above else ()
    mode_table = Table(file, names, units, np.array(values), lines)
    return Recording(file, mode_table=mode_table, notes=notes)


def _row(
    file: TextFile, names: tuple[str, ...], line: int, text: str, delimiter: str | None
) -> list[float]:
    cells = cells_of(text, delimiter)
    if len(cells) != len(names):
        raise file.error(
            f"the row has {len(cells)} cells where {len(names)} are expected; leave a cell blank"
            " between its delimiters where nothing is known",
            line,
        )
    return [
        _value(file, line, name, cell, delimiter) for name, cell in zip(names, cells, strict=True)
    ]


def _value(file: TextFile, line: int, name: str, cell: str, delimiter: str | None) -> float:
    if cell.lower() in _BLANK:
        return np.nan
    try:
        value = float(cell if delimiter == "," else cell.replace(",", "."))
    except ValueError:
        value = _number_in(cell) if figure_of(name) == MODE else np.nan
    if not np.isfinite(value):
        raise file.error(
            f"{cell!r} is not a number; write one or leave the cell blank", line, repr(name)
        )
    return value


def _number_in(name: str) -> float:
    """The number of a mode, from a name such as `EFDD Mode 3`."""
    numbers = re.findall(r"\d+", name)
    return float(numbers[-1]) if numbers else np.nan


READER = Reader("modes", "tables of identified modes", _recognises, _read)
