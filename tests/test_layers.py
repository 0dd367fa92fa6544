"""Packages import only what stands above them in the table of docs, and no files in a circle."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIBRARY = ROOT / "femupdate"
TABLE = ROOT / "docs" / "architecture.md"
ABOVE_ALL = ("interface.py", "__main__.py", "__init__.py")


def imported(path):
    """Modules of the library that a file imports, anywhere in it, as paths from its root."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom) and not node.level:
            names = [node.module, *(f"{node.module}.{one.name}" for one in node.names)]
        elif isinstance(node, ast.Import):
            names = [one.name for one in node.names]
        for name in names:
            file = ROOT.joinpath(*name.split(".")).with_suffix(".py")
            if file.is_relative_to(LIBRARY) and file.exists():
                yield file.relative_to(LIBRARY)


@cache
def arrows():
    """Every file of the library with the files that it imports."""
    files = LIBRARY.rglob("*.py")
    return {path.relative_to(LIBRARY): set(imported(path)) for path in files}


def packages_in_order():
    """Packages in the order of the table; modules beside them belong to all."""
    rows = TABLE.read_text(encoding="utf-8").split("## Rooms")[1].split("## ")[0]
    names = [name for cell in re.findall(r"^\| (`.*?) \|", rows, re.M) for name in cell.split(", ")]
    return [name for name in (one.strip("`") for one in names) if (LIBRARY / name).is_dir()]


def test_the_table_lists_every_package():
    there = {path.parent.name for path in LIBRARY.glob("*/__init__.py")}
    assert sorted(packages_in_order()) == sorted(there)


def test_packages_import_those_above_them():
    order = packages_in_order()
    wrong = [
        f"{file} imports {other}"
        for file, others in arrows().items()
        for other in others
        if other.parts[0] in order
        and (file.parts[0] not in order or order.index(other.parts[0]) > order.index(file.parts[0]))
        and str(file) not in ABOVE_ALL
    ]
    assert not wrong


def test_no_files_import_each_other_in_a_circle():
    assert list(TopologicalSorter(arrows()).static_order())
