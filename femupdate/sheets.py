"""Tables as files for spreadsheets: CSV always, one XLSX workbook of them where asked for."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from femupdate.errors import StudyError
from femupdate.storage import write_bytes
from femupdate.study import write_text
from femupdate.tables import csv_text

_WIDEST = 60  # characters of a column


@dataclass(frozen=True)
class Sheet:
    """One table, with one observation a row.

    Attributes:
        name: of the file and of the sheet.
        head: a heading for every column, with its unit where no column has the units.
        rows: numbers and texts.
    """

    name: str
    head: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    @classmethod
    def of(cls, name: str, head: Sequence[str], rows: Iterable[Iterable[Any]]) -> "Sheet":
        """From any rows."""
        return cls(name, tuple(head), tuple(tuple(row) for row in rows))


def write_sheets(
    folder: Path, sheets: Sequence[Sheet], workbook: str | None = None
) -> tuple[Path, ...]:
    """Write every table as CSV, and all of them into one workbook where it has a name.

    Raises:
        StudyError: a file cannot be written, or XlsxWriter is not installed.
    """
    paths = [folder / f"{sheet.name}.csv" for sheet in sheets]
    if workbook is not None:
        path = folder / f"{workbook}.xlsx"
        write_bytes(path, _workbook(sheets))
        paths.insert(0, path)
    for sheet in sheets:
        write_text(folder / f"{sheet.name}.csv", csv_text(sheet.head, sheet.rows))
    return tuple(paths)


def require_xlsx() -> None:
    """Make sure that workbooks can be written, before anything is computed.

    Raises:
        StudyError: they cannot.
    """
    from importlib.util import find_spec

    if find_spec("xlsxwriter") is None:
        raise StudyError(
            "--xlsx needs XlsxWriter; install it with `pip install xlsxwriter`, or use the CSV "
            "files, which are always written"
        )


def _workbook(sheets: Sequence[Sheet]) -> bytes:
    """All tables, with headings that stay in sight and filters; texts are never formulas."""
    import xlsxwriter

    require_xlsx()
    content = BytesIO()
    choices = {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    with xlsxwriter.Workbook(content, {**choices, "nan_inf_to_errors": True}) as book:
        bold = book.add_format({"bold": True, "bottom": 1})
        for sheet in sheets:
            page = book.add_worksheet(sheet.name)
            page.write_row(0, 0, sheet.head, bold)
            for number, row in enumerate(sheet.rows, start=1):
                page.write_row(number, 0, row)
            page.freeze_panes(1, 0)
            page.autofilter(0, 0, len(sheet.rows), len(sheet.head) - 1)
            for column, width in enumerate(_widths(sheet)):
                page.set_column(column, column, width)
    return content.getvalue()


def _widths(sheet: Sheet) -> list[int]:
    """Characters of the widest cell of every column; numbers show about ten."""
    columns = zip(sheet.head, *sheet.rows[:200], strict=True)
    longest = (max(len(cell) if isinstance(cell, str) else 10 for cell in one) for one in columns)
    return [min(length + 2, _WIDEST) for length in longest]
