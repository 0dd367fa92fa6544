"""Tables and notes in words."""

from collections.abc import Iterable, Sequence


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
