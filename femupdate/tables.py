"""Tables and notes in words."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

# A number with its unit or interval, or nothing.
_NUMBER = re.compile(r"((over |under )?[-+−]?[\d.]+(e[-+]?\d+)?( ?%)?( \[.*\])?|nan|-)?")


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table for people, on the terminal and on the page; its first column names its rows.

    Attributes:
        name: of its CSV file, without ending.
        caption: what it shows.
        head: of the columns.
        rows: cells as text.
        note: how to read it.
    """

    name: str
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    kind: str = "table"

    def text(self, corner: str | None = None) -> str:
        """For the terminal; another heading of the first column may say what it is."""
        first, *others = self.head
        return table((first if corner is None else corner, *others), self.rows)

    @property
    def sides(self) -> tuple[str, ...]:
        """Class of the cells of every column: `number`, or `words`, which stand to the left."""
        columns = zip(*self.rows, strict=True) if self.rows else [()] * len(self.head)
        return tuple(
            "number" if all(_NUMBER.fullmatch(cell) for cell in column) else "words"
            for column in columns
        )


def table(
    head: tuple[str, ...], rows: Sequence[tuple[str, ...]], *, words_last: bool = False
) -> str:
    """Return a table, a row on a line, with the first column aligned left, the others right.

    Args:
        head: of the columns.
        rows: cells.
        words_last: align the last column left as well.
    """
    left = {0, len(head) - 1} if words_last else {0}
    widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
    lines = []
    for row in [head, *rows]:
        cells = [
            cell.ljust(width) if k in left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  " + "  ".join(cells).rstrip())
    return "\n".join(lines)


def first_notes(notes: Sequence[str], rest: str, most: int = 6) -> list[str]:
    """Return the first notes, a line each, and how many more there are.

    Args:
        notes: sentences, the decisive first.
        rest: where the others are.
        most: that are shown.
    """
    lines = [f"  - {note}" for note in notes[:most]]
    if (more := len(notes) - most) > 0:
        lines.append(f"  - {more} more {'note' if more == 1 else 'notes'}: {rest}")
    return lines


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a comma-separated table; numbers keep all their digits."""
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()
