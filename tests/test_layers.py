"""Packages import only what stands above them in the table of docs, and no files in a circle."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIBRARY = ROOT / "femupdate"
TABLE = ROOT / "docs" / "architecture.md"
# What imports by a name that is not written there: public names, commands, the modules of a folder,
# and packages that someone may not have.
LAZY = {
    *("femupdate/lazy.py", "cli/group.py", "cli/benchmark.py"),
    *("femupdate/registry.py", "femupdate/measurement/reader.py", "femupdate/measurement/text.py"),
}
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


def test_no_import_hides_from_these_tests():
    """`import_module` is for public names on demand, for what is found in a folder, and others'."""
    wrong = [
        f"{path.relative_to(ROOT)}: {ast.unparse(node)}"
        for path in (*LIBRARY.rglob("*.py"), *(ROOT / "cli").rglob("*.py"))
        if str(path.relative_to(ROOT)) not in LAZY
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func).endswith(("import_module", "__import__"))
        and not (isinstance(node.args[0], ast.Constant) and "femupdate" not in node.args[0].value)
    ]
    assert not wrong


def test_no_files_import_each_other_in_a_circle():
    assert list(TopologicalSorter(arrows()).static_order())
