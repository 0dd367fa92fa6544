"""Plain tables: named columns, or a column of times and one or several of acceleration."""

from pathlib import Path

from femupdate.measurement.clock import is_moment
from femupdate.measurement.names import FREQUENCY_NAME, TIME_NAME
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import (
    MOMENT_CELLS,
    cells_of,
    find_delimiter,
    is_number,
    read_table,
    rows_of_table,
    split_complex,
    without_decibels,
)
from femupdate.measurement.text import TextFile, read_text

READS = "tables in CSV or other text"
FALLBACK = True


def recognises(head: str, suffix: str) -> bool:
    """Whether a file begins like a table: with a column of times or rows of numbers."""
    rows = TextFile(Path(), tuple(head.split("\n"))).rows()[:50]
    rows = split_complex(rows) if rows else rows
    cells = [cells_of(text, find_delimiter(text)) for _, text in rows]
    axes = (TIME_NAME, FREQUENCY_NAME)
    named = bool(cells) and any(axis.match(cell) for cell in cells[0] for axis in axes)
    dated = any(is_moment(" ".join(row[a:b])) for row in cells for a, b in MOMENT_CELLS)
    return named or dated or any(all(map(is_number, row)) for row in cells)


def read(path: Path) -> Recording:
    return table_in(read_text(path))


def table_in(file: TextFile) -> Recording:
    """The table in a text."""
    above = len(file.rows()) - len(rows_of_table(file))
    notes = (f"Lines above the table that are passed over: {above}.",)
    return Recording(file, table=without_decibels(read_table(file)), notes=notes if above else ())
