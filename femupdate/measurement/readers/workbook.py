"""Sheets of spreadsheets, as the tables that they would be in text."""

import zipfile
from pathlib import Path

from femupdate.measurement.readers import modes, plain
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import is_number
from femupdate.measurement.text import TextFile, reading_package
from femupdate.storage import LARGEST_BYTES

READS = "workbooks (.xlsx)"


def recognises(head: str, suffix: str) -> bool:
    return suffix in (".xlsx", ".xlsm") and head.startswith("PK\x03\x04")


def read(path: Path) -> Recording:
    """The one sheet that holds rows of numbers; values of formulas as they were saved."""
    file = TextFile(path, row_name="row")
    openpyxl = reading_package(file, "openpyxl", "openpyxl", "workbooks")
    with zipfile.ZipFile(path) as packed:
        names = {member.filename: member.file_size for member in packed.infolist()}
    size = sum(names.values())
    if size > LARGEST_BYTES:
        raise file.error(f"the workbook unpacks to {size / 1e9:.3g} GB; export it as CSV")
    if names and not any(name.startswith("xl/worksheets/") for name in names):
        raise file.error("the workbook holds no sheet of cells, such as a chart alone; export CSV")
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    texts = {
        sheet.title: [
            "\t".join("" if cell is None else " ".join(str(cell).split()) for cell in row)
            for row in sheet.iter_rows(values_only=True)
        ]
        for sheet in book.worksheets
    }
    tables = {
        title: lines
        for title, lines in texts.items()
        if sum(sum(map(is_number, line.split("\t"))) > 1 for line in lines) > 2
    }
    if len(tables) != 1:
        held = f"tables on {len(tables)} sheets ({', '.join(tables)})" if tables else "no table"
        raise file.error(
            f"the workbook holds {held}; save the one to read in a workbook of its own"
        )
    ((title, lines),) = tables.items()
    sheet = TextFile(path, tuple(lines), f"sheet {title!r}, row")
    of_modes = modes.recognises("\n".join(lines[:50]), "")
    return (modes if of_modes else plain).table_in(sheet)
