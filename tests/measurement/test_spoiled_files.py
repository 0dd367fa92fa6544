"""Files as people spoil them: one sentence with place and cure, exit code 1, nothing written."""

import numpy as np
import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

RNG = np.random.default_rng(0)
TIME = 0.01 * np.arange(400)
MOTION = RNG.normal(size=(4, 400)) * [[0.3], [0.4], [0.5], [0.6]]


def table(*, head="time_s,base,2F,3F,RF", units="s,m/s2,m/s2,m/s2,m/s2", change=None):
    rows = [[f"{value:.6g}" for value in row] for row in np.column_stack([TIME, MOTION.T])]
    for at, column, text in change or ():
        rows[at][column] = text
    return "\n".join([*filter(None, (head, units)), *(",".join(row) for row in rows)]) + "\n"


def frfs(*rows, head="frequency_hz,2F,3F,RF"):
    return "\n".join([head, *rows]) + "\n"


GOOD = [f"{f:.1f},1.1,1.2,1.3" for f in np.arange(1.0, 4.0, 0.1)]
MODES = "mode,frequency_hz,damping (%),2F,3F,RF\n"
BARE = "\n".join(",".join(f"{v:.5g}" for v in row) for row in MOTION.T) + "\n"
TEXTS = {
    "blanks alone": ("\n\n\n", ()),
    "a page of the web": ("<!DOCTYPE html><html><body>404</body></html>", ()),
    "json": ('{"time": [0, 1], "base": [1, 2]}', ()),
    "an error of a sheet": (table(change=[(7, 2, "#DIV/0!")]), ()),
    "a unit of force": (table(units="s,m/s2,kN,m/s2,m/s2"), ()),
    "times that stand still": (table(change=[(k, 0, "1.0") for k in range(400)]), ()),
    "times that go back": (table(change=[(200, 0, "0.5")]), ()),
    "a channel all blank": (table(change=[(k, 3, "") for k in range(400)]), ()),
    "no header, a column of none": (BARE, ("--columns", "base=1,2F=2,3F=3,RF=9")),
    "a shape of nothing": (MODES + "1,3.8,2,0,0,0\n", ()),
    "tests without a row": ("test,f1,f2,f3\n", ()),
    "tests with a word": ("test,f1,f2\n1,3.8,ten\n", ()),
    "tests below zero": ("test,f1,f2\n1,3.8,-10\n2,3.9,-11\n", ()),
    "a column by a number too high": (table(), ("--columns", "base=2,2F=3,RF=9")),
    "volts without a factor": (table(units="s,V,V,V,V"), ()),
    "a complex cell cut": (frfs("1.0,1+1j,1+2j,1+3", "2.0,1+1j,1+,1+3"), ()),
    "a force of no force test": (table(), ("--force", "RF")),
    "a month that is none": (
        table(change=[(k, 0, f"5 Foo 2024 10:00:{k / 10:.1f}") for k in range(400)]),
        (),
    ),
    "complex numbers as histories": (table(change=[(k, 2, "1+2j") for k in range(400)]), ()),
}


def refused(path, more, tmp_path):
    study = tmp_path / "study"
    words = ["calibrate", str(path), "--building", "shear_3dof", "--study", str(study), *more]
    result = CliRunner().invoke(group, words)
    assert isinstance(result.exception, SystemExit), result.output
    assert result.exit_code == 1, result.output
    (said,) = [line for line in result.output.splitlines() if line.startswith("Error: ")]
    assert result.output.count("\n") == 1, result.output
    assert len(said) > 30
    assert path.name in said or any(word in said for word in more), said
    assert not study.exists()
    return said


@pytest.mark.parametrize("name", TEXTS)
def test_a_spoiled_table_is_refused(name, tmp_path):
    text, more = TEXTS[name]
    path = tmp_path / "run.csv"
    path.write_text(text, encoding="utf-8")
    refused(path, more, tmp_path)


def test_a_workbook_with_a_chart_alone_is_refused(tmp_path):
    book = pytest.importorskip("openpyxl").Workbook()
    book.create_chartsheet("Plot")
    book.remove(book.active)
    book.save(tmp_path / "run.xlsx")
    assert "no sheet of cells" in refused(tmp_path / "run.xlsx", (), tmp_path)


@pytest.mark.parametrize("suffix", [".xlsx", ".uff", ".mat", ".npz", ".tdms", ".zip", ".mseed"])
def test_half_a_file_is_refused(suffix, tmp_path):
    path = tmp_path / f"run{suffix}"
    path.write_bytes(b"PK\x03\x04 not the rest" if suffix != ".uff" else b"    -1\n    58\nhalf")
    refused(path, (), tmp_path)
