"""Tables of identified modes in text: a column of frequencies, cells may be blank."""

import re
from pathlib import Path

from femupdate.measurement.modes import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE, figure_of
from femupdate.measurement.names import FREQUENCY
from femupdate.measurement.quantity import bracketed
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import (
    ColumnTable,
    Row,
    cells_of,
    find_delimiter,
    is_number,
    parse_rows,
    read_head_rows,
    split_complex,
)
from femupdate.measurement.text import TextFile, read_text

READS = "tables of identified modes"

# Columns that no table of histories or of response functions has.
_TELLING = (MODE, FREQUENCY_SD, DAMPING, DAMPING_SD)
_BLANK = ("", "-", "–", "nan", "n/a", "na", "none")
_LEAST_TOLD, _MOST_ABOVE = 2, 10


def recognises(head: str, suffix: str) -> bool:
    """Whether a row above the numbers names columns that only identified modes have."""
    if "\0" in head:
        return False
    return _header_at(TextFile(Path(), tuple(head.split("\n"))).rows()) is not None


def _header_at(rows: list[Row]) -> int | None:
    """Index of the row that names the columns, the first or one below what programs write."""
    for index, (_, text) in enumerate(rows[:_MOST_ABOVE]):
        figures = [figure_of(bracketed(cell)[0]) for cell in cells_of(text, find_delimiter(text))]
        telling = any(figure in _TELLING for figure in figures) and len(figures) >= _LEAST_TOLD
        if telling and (index == 0 or FREQUENCY in figures):
            return index
    return None


def read(path: Path) -> Recording:
    """A table whose cells may be blank."""
    file = read_text(path)
    rows = file.rows()
    above = _header_at(rows) or 0
    rows = split_complex(rows[above:], _BLANK)
    delimiter = find_delimiter(rows[0][1])
    names, units, rows = read_head_rows(file, rows, delimiter, bracketed)
    if names is None or units is None:
        raise file.error("the first cell of the header is a number; name its column", rows[0][0])
    filled = [(line, _filled(text, delimiter, names)) for line, text in rows]
    values, lines = parse_rows(file, filled, delimiter, names, missing=True)
    notes = (f"Lines above the table that are passed over: {above}.",) if above else ()
    return Recording(file, mode_table=ColumnTable(file, names, units, values, lines), notes=notes)


def _filled(text: str, delimiter: str | None, names: tuple[str, ...]) -> str:
    """A row with `nan` in blank cells, and the number in the name of a mode: `EFDD Mode 3`."""
    cells = cells_of(text, delimiter)
    for k, (cell, name) in enumerate(zip(cells, names, strict=False)):
        numbers = re.findall(r"\d+", cell)
        if cell.lower() in _BLANK:
            cells[k] = "nan"
        elif numbers and not is_number(cell) and figure_of(name) == MODE:
            cells[k] = numbers[-1]
    return (delimiter or " ").join(cells)
