"""Tables of identified modes in text: a column of frequencies, cells may be blank."""

import re
from pathlib import Path

import numpy as np

from femupdate.measurement.modes import DAMPING, MODE, PERIOD, TELLING, TEST, figure_of
from femupdate.measurement.names import (
    FREQUENCY,
    TIME_NAME,
    bracketed,
    is_acceleration,
    parse_channel,
)
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
    unquoted,
    whole_row,
)
from femupdate.measurement.text import TextFile, read_text

READS = "tables of identified modes"

_LEAST_TOLD, _MOST_ABOVE = 2, 10
# f1, zeta_2, Mode 3, 2nd mode: a figure of one mode in a table with a row for each test.
_NUMBERED = re.compile(
    r"(?P<what>[^\W\d](?:\D*[^\d _.])?)[ _.]*(?P<mode>[1-9]\d?)"
    r"|(?P<first>[1-9])(st|nd|rd|th) (?P<behind>.+)"
)
# What spreadsheets put below a table.
_SUMMARY = re.compile(
    r"(mean|average|avg|median|mittel(wert)?|std|sd|standard deviation|cov|min|max|sum)[.:]?", re.I
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
    rows = unquoted(file.rows())
    above = _header_at(rows) or 0
    rows = split_complex(rows[above:])
    delimiter = find_delimiter(rows[0][1])
    for line, text in rows[1:]:
        if _SUMMARY.fullmatch(label := cells_of(text, delimiter)[0]):
            raise file.error(f"{label!r} is no mode and no test; remove the row", line)
    of_tests = _of_tests(rows[0][1])
    if of_tests:
        return _in_rows(file, rows, of_tests)
    names, units, rows = read_head_rows(file, rows, delimiter, bracketed)
    if names is None or units is None:
        raise file.error("the first cell of the header is a number; name its column", rows[0][0])
    values, lines = parse_rows(
        file, _numbered(rows, delimiter, names), delimiter, names, blanks=True
    )
    notes = [f"Lines above the table that are passed over: {above}."] if above else []
    table = ColumnTable(file, names, units, values, lines)
    of_test = [values[:, k] for k, name in enumerate(names) if figure_of(name) == TEST]
    if of_test and 1 < (tests := len({*of_test[0].tolist()})) < len(rows):
        notes.append(_MEANS.format(tests))
    return Recording(file, mode_table=table, notes=tuple(notes))


def _of_tests(head: str) -> dict[int, tuple[str, int, float]]:
    """Figure, mode and factor of each column of a table with a row for each test; else none."""
    titles = [bracketed(cell) for cell in cells_of(head, find_delimiter(head))]
    found = {}
    for k, (title, unit) in enumerate(titles):
        of = _NUMBERED.fullmatch(title)
        figure = figure_of(of["what"] or of["behind"]) if of else None
        figure = FREQUENCY if figure == MODE and unit == "Hz" else figure
        if of and (figure in (FREQUENCY, DAMPING) or (figure == PERIOD and unit in (None, "s"))):
            found[k] = figure, int(of["mode"] or of["first"]), 0.01 if unit == "%" else 1.0
    hertz = any(titles[k][1] == "Hz" for k in found)
    timed = not hertz and any(
        TIME_NAME.match(title) or parse_channel(title) or is_acceleration(unit or "")
        for title, unit in titles
    )
    several = [figure for figure, _, _ in found.values() if figure != DAMPING]
    return found if len(several) > 1 and len(set(several)) == 1 and not timed else {}


_MEANS = "{} tests: of every mode the mean with its standard error."


def _in_rows(
    file: TextFile, rows: list[Row], columns: dict[int, tuple[str, int, float]]
) -> Recording:
    """A table with a row for each test as one with a row for each of its modes."""
    delimiter = find_delimiter(rows[0][1])
    heads, mark = cells_of(rows[0][1], delimiter), delimiter or " "
    table = [(line, whole_row(file, line, text, delimiter, len(heads))) for line, text in rows[1:]]
    picked = [(line, mark.join(cells[k] for k in columns)) for line, cells in table]
    titles = tuple(heads[k] for k in columns)
    values, lines = parse_rows(file, picked, delimiter, titles, blanks=True)
    modes = sorted({mode for _, mode, _ in columns.values()})
    names = tuple(dict.fromkeys((TEST, MODE, *(figure for figure, _, _ in columns.values()))))
    long = np.full((len(values), len(modes), len(names)), np.nan)
    long[:, :, 0], long[:, :, 1] = np.arange(len(values))[:, None], modes
    for (figure, mode, factor), column in zip(columns.values(), values.T, strict=True):
        long[:, modes.index(mode), names.index(figure)] = factor * column
    rate = PERIOD if PERIOD in names else FREQUENCY
    rates = long[:, :, names.index(rate)]
    seen = np.isfinite(rates)
    falls = (np.diff(rates, axis=1) * (-1.0 if rate == PERIOD else 1.0) < 0.0).any()
    units, lines = (None,) * len(names), lines[np.nonzero(seen)[0]]
    found = ColumnTable(file, names, units, long[seen], lines)
    notes = _MEANS.format(len(values)), "The modes are not numbered by frequency."
    return Recording(file, mode_table=found, notes=notes if falls else notes[:1])


def _numbered(rows: list[Row], delimiter: str | None, names: tuple[str, ...]) -> list[Row]:
    """Rows with numbers in place of names of modes, `EFDD Mode 3` or `T1`, and of tests."""
    figures, table = (
        [figure_of(name) for name in names],
        [cells_of(row, delimiter) for _, row in rows],
    )
    for k, figure in enumerate(figures):
        labels = dict.fromkeys(cells[k] for cells in table if k < len(cells))
        if figure not in (MODE, TEST) or (figure == MODE and all(map(is_number, labels))):
            continue
        last = [re.findall(r"\d+", label)[-1:] for label in labels]
        apart = figure == MODE and all(last) and len({*map(tuple, last)}) == len(labels)
        number = {label: last[n][0] if apart else str(n + 1) for n, label in enumerate(labels)}
        for cells in table:
            cells[k : k + 1] = [number[cell] for cell in cells[k : k + 1]]
    return [
        (line, (delimiter or " ").join(cells)) for (line, _), cells in zip(rows, table, strict=True)
    ]
