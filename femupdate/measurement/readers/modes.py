"""Tables of identified modes in text: a column of frequencies, cells may be blank."""

import re
from pathlib import Path

import numpy as np

from femupdate.measurement.cells import cells_of, find_delimiter, is_number
from femupdate.measurement.complex_text import split_complex
from femupdate.measurement.mode_table import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE, figure_of
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile, read_text

# Columns that no table of histories or of response functions has.
_TELLING = (MODE, FREQUENCY_SD, DAMPING, DAMPING_SD)
_BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[]\s*(?P<unit>[^()\[\]]+?)\s*[)\]]")
_BLANK = ("", "-", "–", "nan", "n/a", "na", "none")
_LEAST_TOLD = 2


def _recognises(head: str, suffix: str) -> bool:
    """Whether the first row names columns that only identified modes have."""
    rows = TextFile(Path(), tuple(head.split("\n"))).rows()
    if not rows or "\0" in head:
        return False
    titles = [_title(cell)[0] for cell in cells_of(rows[0][1], find_delimiter(rows[0][1]))]
    telling = sum(figure_of(title) in _TELLING for title in titles)
    return telling >= 1 and len(titles) >= _LEAST_TOLD


def _read(path: Path) -> Recording:
    """A table whose cells may be blank.

    Raises:
        MeasurementError: a row has another number of cells, or a cell is text.
    """
    file = read_text(path)
    rows = split_complex(file.rows(), _BLANK)
    delimiter = find_delimiter(rows[0][1])
    titles = [_title(cell) for cell in cells_of(rows[0][1], delimiter)]
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
    return Recording(file, mode_table=Table(file, names, units, np.array(values), lines))


def _title(cell: str) -> tuple[str, str | None]:
    match = _BRACKETED.fullmatch(cell)
    return (match["name"], match["unit"]) if match else (cell, None)


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
