"""Tables of identified modes in text: a column of frequencies, cells may be blank."""

import re
from pathlib import Path

import numpy as np

from femupdate.measurement.modes import (
    DAMPING,
    DAMPING_SD,
    FREQUENCY_SD,
    MODE,
    TELLING,
    figure_of,
)
from femupdate.measurement.names import FREQUENCY, TIME_NAME
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

_LEAST_TOLD, _MOST_ABOVE = 2, 10
# f1, zeta_2, Mode 3, 2nd mode: a figure of one mode in a table with a row for each test.
_NUMBERED = re.compile(
    r"(?P<what>[^\W\d](?:\D*[^\d _.])?)[ _.]*(?P<mode>[1-9]\d?)"
    r"|(?P<first>[1-9])(st|nd|rd|th) (?P<behind>.+)"
)


def recognises(head: str, suffix: str) -> bool:
    """Whether a row above the numbers names columns that only identified modes have."""
    if "\0" in head:
        return False
    return _header_at(TextFile(Path(), tuple(head.split("\n"))).rows()) is not None


def _header_at(rows: list[Row]) -> int | None:
    """Index of the row that names the columns, the first or one below what programs write."""
    for index, (_, text) in enumerate(rows[:_MOST_ABOVE]):
        figures = [figure_of(bracketed(cell)[0]) for cell in cells_of(text, find_delimiter(text))]
        telling = any(figure in TELLING for figure in figures) and len(figures) >= _LEAST_TOLD
        if (telling and (index == 0 or FREQUENCY in figures)) or _of_tests(text):
            return index
    return None


def read(path: Path) -> Recording:
    return table_in(read_text(path))


def table_in(file: TextFile) -> Recording:
    """The table in a text, whose cells may be blank."""
    rows = file.rows()
    above = _header_at(rows) or 0
    rows = split_complex(rows[above:])
    delimiter = find_delimiter(rows[0][1])
    of_tests = _of_tests(rows[0][1])
    if of_tests:
        return _means(file, rows, of_tests)
    names, units, rows = read_head_rows(file, rows, delimiter, bracketed)
    if names is None or units is None:
        raise file.error("the first cell of the header is a number; name its column", rows[0][0])
    numbered = [(line, _numbered(text, delimiter, names)) for line, text in rows]
    values, lines = parse_rows(file, numbered, delimiter, names, blanks=True)
    notes = (f"Lines above the table that are passed over: {above}.",) if above else ()
    return Recording(file, mode_table=ColumnTable(file, names, units, values, lines), notes=notes)


def _of_tests(head: str) -> dict[int, tuple[str, int, float]]:
    """Figure, mode and factor of each column of a table with a row for each test; else none."""
    titles = [bracketed(cell) for cell in cells_of(head, find_delimiter(head))]
    found = {}
    for k, (title, unit) in enumerate(titles):
        of = _NUMBERED.fullmatch(title)
        figure = figure_of(of["what"] or of["behind"]) if of else None
        figure = FREQUENCY if figure == MODE and unit == "Hz" else figure
        if of and figure in (FREQUENCY, DAMPING):
            found[k] = figure, int(of["mode"] or of["first"]), 0.01 if unit == "%" else 1.0
    hertz = any(titles[k][1] == "Hz" for k in found)
    timed = any(TIME_NAME.match(title) for title, _ in titles) and not hertz
    several = sum(figure == FREQUENCY for figure, _, _ in found.values()) > 1
    return found if several and not timed else {}


def _means(
    file: TextFile, rows: list[Row], columns: dict[int, tuple[str, int, float]]
) -> Recording:
    """Modes with their means over all tests and the standard errors of these."""
    delimiter = find_delimiter(rows[0][1])
    table = [(line, cells_of(text, delimiter) + [""] * len(columns)) for line, text in rows[1:]]
    mark = delimiter or " "
    picked = [(line, mark.join(cells[k] for k in columns)) for line, cells in table]
    titles = tuple(cells_of(rows[0][1], delimiter)[k] for k in columns)
    values, _ = parse_rows(file, picked, delimiter, titles, blanks=True)
    modes = sorted({mode for _, mode, _ in columns.values()})
    means = np.full((len(modes), 5), np.nan)
    means[:, 0] = modes
    for (figure, mode, factor), column in zip(columns.values(), values.T, strict=True):
        seen = factor * column[np.isfinite(column)]
        row, at = modes.index(mode), 1 if figure == FREQUENCY else 3
        if seen.size:
            means[row, at] = seen.mean()
        if np.ptp(seen) if seen.size else 0.0:
            means[row, at + 1] = seen.std(ddof=1) / np.sqrt(seen.size)
    names = (MODE, FREQUENCY, FREQUENCY_SD, DAMPING, DAMPING_SD)
    lines = np.full(len(modes), rows[0][0])
    said = f"{len(rows) - 1} tests, a row each: of every mode the mean with its standard error."
    return Recording(
        file, mode_table=ColumnTable(file, names, (None,) * 5, means, lines), notes=(said,)
    )


def _numbered(text: str, delimiter: str | None, names: tuple[str, ...]) -> str:
    """A row with the number in the name of a mode: `EFDD Mode 3`."""
    cells = cells_of(text, delimiter)
    for k, (cell, name) in enumerate(zip(cells, names, strict=False)):
        numbers = re.findall(r"\d+", cell)
        if numbers and not is_number(cell) and figure_of(name) == MODE:
            cells[k] = numbers[-1]
    return (delimiter or " ").join(cells)
