"""Cells of a row of text: what parts them, complex numbers as two, moments as seconds."""

import re
from collections.abc import Sequence

import numpy as np

from femupdate.measurement.columns import TIME
from femupdate.measurement.thresholds import FILES

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
        rows: of a table, its header first.
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

    def apart(line: int, text: str) -> Row:
        cells = []
        for k, cell in enumerate(cells_of(text, delimiter)):
            cells += _parts(cell, blanks) if k in complex_columns else [cell]
        return line, mark.join(cells)

    head = []
    for k, title in enumerate(titles):
        head += [_named(title, part) for part in ("re", "im")] if k in complex_columns else [title]
    return [(rows[0][0], mark.join(head)), *(apart(*row) for row in rows[1:])]


def _complex(cell: str) -> re.Match[str] | None:
    return _COMPLEX.fullmatch(cell) if len(cell) <= FILES.longest_cell else None


def _named(title: str, part: str) -> str:
    """`2F_re` of `2F`; a unit in brackets stays behind the name."""
    name, bracket, unit = title.partition("(") if "(" in title else title.partition("[")
    return f"{name.strip()}_{part}{' ' if bracket else ''}{bracket}{unit}"


def _parts(cell: str, blanks: Sequence[str]) -> list[str]:
    """Real and imaginary part of a cell; of what is not complex the cell itself and zero."""
    match = _complex(cell)
    if match is not None:
        return [match["re"] or "0", re.sub(r"\s", "", match["im"])]
    return [cell, cell] if cell.lower() in blanks else [cell, "0"]


# 2020-01-31 12:00:00.005, also with T and Z, or 12:00:00.005 alone.
_MOMENT = re.compile(
    r"(?P<date>\d{4}[-/]\d\d[-/]\d\d)?[T ]?(?P<time>\d\d:\d\d:\d\d(?:[.,]\d{1,9})?)Z?"
)


def in_seconds(rows: list[Row], delimiter: str | None) -> list[Row]:
    """Rows whose first cells are times in seconds since the first, where all are moments.

    Their column is called `time_s`.

    Args:
        rows: of a table, its header first or not.
        delimiter: of the cells.
    """
    if not _MOMENT.fullmatch(cells_of(rows[-1][1], delimiter)[0]):
        return rows  # as nearly all tables: not a row more need be looked at
    first = [cells_of(text, delimiter)[0] for _, text in rows]
    found = [_MOMENT.fullmatch(cell) for cell in first]
    start = next((k for k, one in enumerate(found) if one), len(rows))
    plain = all(text.strip().startswith(cell) for (_, text), cell in zip(rows, first, strict=True))
    if start == len(rows) or not all(found[start:]) or not plain:
        return rows
    moments = np.array(
        [
            f"{(one['date'] or '2000-01-01').replace('/', '-')}T{one['time'].replace(',', '.')}"
            for one in found[start:]
            if one
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
