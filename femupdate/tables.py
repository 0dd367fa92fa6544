"""Tables, described once: for people on terminal and page, as CSV, and as JSON."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femupdate.study import write_text

# A number with its unit or interval, or nothing.
_NUMBER = re.compile(r"((over |under )?[-+−]?[\d.]+(e[-+]?\d+)?( ?%)?( \[.*\])?|nan|-)?")


@dataclass(frozen=True)
class Column:
    """One column of a table; each of its readers leaves it out where it has no name for it.

    Attributes:
        values: one a row, numbers or texts; of a long column that only the CSV file has, what
            makes them.
        head: over it for people; None where they are not shown it.
        cells: as people read them; default the values as text.
        csv: heading in the CSV file, with its unit.
        key: in JSON.
    """

    values: Any
    head: str | None = None
    cells: Sequence[str] | None = None
    csv: str = ""
    key: str = ""

    @property
    def texts(self) -> Sequence[str]:
        """What people read."""
        return [str(value) for value in self.values] if self.cells is None else self.cells

    @property
    def plain(self) -> list[Any]:
        """The values without arrays; a number that is none, and None, is blank."""
        values = self.values
        if callable(values):
            import numpy as np

            values = np.ravel(values())
        values = values.tolist() if hasattr(values, "tolist") else values
        return ["" if value is None or value != value else value for value in values]


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table whose first column names its rows.

    Attributes:
        name: of its CSV file, without ending.
        columns: all of the same length.
        key: of a list of its rows in JSON.
        corner: heading of the first column on the terminal, where another says what it is.
        words_last: the last column is of words, which stand to the left.
        most: rows that the terminal shows; None for all, 0 where the page alone shows it.
        detail: on the terminal it is shown to those who ask for more.
    """

    name: str
    columns: tuple[Column, ...]
    caption: str = ""
    note: str = ""
    key: str = ""
    corner: str | None = None
    words_last: bool = False
    most: int | None = None
    detail: bool = False

    @classmethod
    def of(
        cls, head: Sequence[str], rows: Iterable[Sequence[str]], *, name: str = "", **more: Any
    ) -> "Table":
        """A table for people alone, by its rows of cells."""
        columns = list(zip(*rows, strict=True)) or [()] * len(head)
        return cls(name=name, columns=tuple(map(Column, columns, head, columns)), **more)

    @property
    def _shown(self) -> list[Column]:
        return [column for column in self.columns if column.head is not None]

    @property
    def head(self) -> tuple[str, ...]:
        """For people."""
        return tuple(column.head or "" for column in self._shown)

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Cells for people."""
        return list(zip(*(column.texts for column in self._shown), strict=True))

    @property
    def sides(self) -> tuple[str, ...]:
        """Class of the cells of every column: `number`, or `words`, which stand to the left."""
        return tuple(
            "number" if all(map(_NUMBER.fullmatch, column.texts)) else "words"
            for column in self._shown
        )

    def lines(self) -> list[str]:
        """For the terminal."""
        rows = self.rows[: self.most]
        if not rows:
            return []
        first, *others = self.head
        head = (first if self.corner is None else self.corner, *others)
        return [table(head, rows, words_last=self.words_last)]

    def as_dict(self) -> dict[str, Any]:
        """For JSON: a list of rows by keys, or without a key of its own the columns by theirs."""
        columns = {column.key: column.values for column in self.columns if column.key}
        if not self.key:
            return columns
        rows = zip(*columns.values(), strict=True)
        return {self.key: [dict(zip(columns, row, strict=True)) for row in rows]}

    def sheet(self) -> tuple[list[str], list[tuple[Any, ...]]]:
        """Head and rows for a spreadsheet, one observation a row; empty where there are none."""
        columns = {column.csv: column.plain for column in self.columns if column.csv}
        return list(columns), list(zip(*columns.values(), strict=True))


def table(
    head: tuple[str, ...], rows: Sequence[tuple[str, ...]], *, words_last: bool = False
) -> str:
    """Return a table, a row on a line, with the first column aligned left, the others right."""
    left = {0, len(head) - 1} if words_last else {0}
    widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
    sides = [str.ljust if k in left else str.rjust for k in range(len(head))]
    aligned = [
        [put(cell, width) for put, cell, width in zip(sides, row, widths, strict=True)]
        for row in [head, *rows]
    ]
    return "\n".join("  " + "  ".join(cells).rstrip() for cells in aligned)


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a comma-separated table; numbers keep all their digits."""
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()


def write_tables(folder: Path, tables: Iterable[Table]) -> tuple[Path, ...]:
    """Write every table as CSV.

    Raises:
        StudyError: a file cannot be written.
    """
    sheets = {folder / f"{table.name}.csv": table.sheet() for table in tables}
    for path, sheet in sheets.items():
        write_text(path, csv_text(*sheet))
    return tuple(sheets)
