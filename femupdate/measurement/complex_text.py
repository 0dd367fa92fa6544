"""Complex numbers in the cells of tables, such as `0.1+2j`, as two columns."""

import re
from collections.abc import Sequence

from femupdate.measurement.cells import Row, cells_of, find_delimiter, is_number
from femupdate.measurement.thresholds import FILES

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
