"""Files as people spoil them: one sentence with place and cure, exit code 1, nothing written."""

import contextlib
import io
import struct
import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from femupdate.cli.main import group
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from femupdate.errors import MeasurementError
from femupdate.measurement import (
    Histories,
    TextFile,
    inspect_file,
    kind_in,
    read_measured,
    read_observation_file,
    read_record,
)
from femupdate.measurement.names import bracketed
from femupdate.measurement.readers import uff
from femupdate.measurement.table import split_complex
from femupdate.workflow.inspect_files import identify
from tests.measurement import written

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


def test_data_of_no_type_in_a_matlab_file(tmp_path):
    """scipy follows the type as if it were a place in its memory."""
    path = tmp_path / "a.mat"
    savemat(path, {"unit": "m/s2", "fs": 50.0})
    content = bytearray(path.read_bytes())
    at = content.index(struct.pack("<HH", 16, 4) + b"m/s2")  # UTF-8 text of four characters
    content[at : at + 2] = struct.pack("<H", 4112)
    path.write_bytes(content)
    with pytest.raises(MeasurementError, match=r"of a type that does not exist, 4112"):
        read_measured(path)


def test_a_long_cell_takes_no_time():
    rows = [(1, "frequency_hz,RF"), (2, f"1,{'9' * 5000}"), (3, f"2,{'1' * 3000}.{'1' * 3000}x")]
    started = time.process_time()
    assert split_complex(rows) == rows
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize("head", ["mode,fr{}equency_hz,RF", "frequenc{}y_hz,RF,RF_sd"])
def test_a_long_title_takes_no_time(write, head):
    titles = head.format(" " * 20_000)
    path = write(f"{titles}\n1,2,3\n2,3,4\n", "a.csv")
    started = time.process_time()
    with contextlib.suppress(MeasurementError):
        kind_in(read_measured(path))
    assert time.process_time() - started < 1.0


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("damping (%)", ("damping", "%")),
        (" RF [ m/s2 ] ", ("RF", "m/s2")),
        ("RF (north) (g)", ("RF (north)", "g")),
        ("(%)", ("(%)", None)),
        ("RF ()", ("RF ()", None)),
        ("gal(cm/s/s)) ", ("gal(cm/s/s))", None)),
        ("RF (m/s2) north", ("RF (m/s2) north", None)),
    ],
)
def test_what_stands_in_brackets_behind_a_title(title, parts):
    assert bracketed(title) == parts


def test_figures_that_no_force_and_no_motion_has(write, tmp_path):
    rows = "".join(f"{0.02 * k:.2f},{(-1) ** k},{0.1 * k % 1}\n" for k in range(400))
    forced = f"time_s,force/RF (kN),RF (m/s2)\n{rows}8.00,1e300,0\n"
    with pytest.raises(MeasurementError, match="a force of 1e\\+303 N"):
        kind_in(read_measured(write(forced, "hammer.csv")))
    moving = f"time_s,2F (m/s2),RF (m/s2)\n{rows}8.00,1e300,0\n"
    with pytest.raises(MeasurementError, match="holds values above 1e\\+09"):
        identify(write(moving, "ambient.csv"), tmp_path / "modes.csv")


def test_modes_of_any_scale_and_of_no_frequency(write):
    """Scales of a shape mean nothing; no mode has a negative frequency or period."""
    head = "mode,frequency_hz,damping,2F,RF\n"
    large = kind_in(read_measured(write(f"{head}1,2,0.01,1e300+1e298j,-2e300\n", "a.csv")))
    small = kind_in(read_measured(write(f"{head}1,2,0.01,1+0.01j,-2\n", "b.csv")))
    np.testing.assert_allclose(large.shape / large.shape[0, 0], small.shape / small.shape[0, 0])
    for name, wrong in (("frequency_hz", -2), ("period (s)", -2), ("period (s)", 0)):
        rows = f"{head.replace('frequency_hz', name)}1,2,0.01,1,2\n2,{wrong},0.01,1,-2\n"
        with pytest.raises(MeasurementError, match=r"line 3.*no frequency above 0"):
            inspect_file(write(rows, "c.csv"))


def test_sets_without_all_their_values(tmp_path):
    one = {"func_type": 4, "x": np.arange(128.0), "data": np.ones(127)}
    with pytest.raises(MeasurementError, match="127 values at 128 frequencies"):
        uff._function(TextFile(tmp_path / "a.uff"), one, True)
    one = {"type": 55, "analysis_type": 2, "node_nums": [1, 2, 3], "mode_n": 4}
    one |= {"freq": 1.5, "modal_damp_vis": 0.01, "r1": np.ones(2)}
    with pytest.raises(MeasurementError, match="mode 4 has 2 components where its points have 3"):
        list(uff._modes(TextFile(tmp_path / "a.uff"), [one]))


VALUES = np.round(50 * np.sin(0.7 * np.arange(70)) + 0.1 * np.arange(70), 3)
PIECES = st.one_of(st.sampled_from([b"", b"\n", b",", b"-", b"1e999", b"NaN", b"\xff", b"0"]),
                   st.binary(max_size=6))  # fmt: skip
HURT = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), PIECES), min_size=1, max_size=3)


def damaged(data: bytes, hurts: list[tuple[float, int, bytes]]) -> bytes:
    for where, length, piece in hurts:
        at = int(where * len(data))
        data = data[:at] + piece + data[at + length :]
    return data


def zipped(members: dict[str, str]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return stream.getvalue()


def outcome(data: bytes, read):
    """What is read from a file of these bytes, or the sentence with which it is refused."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file.csv"
        path.write_bytes(data)
        try:
            return read(path)
        except MeasurementError as error:
            return str(error)


@pytest.mark.parametrize(
    "kind",
    ["jma", "peer", "csmip_v1", "csmip_v2", "knet", "esm", "cosmos", "smc", "zip", "plain"],
)
@given(hurts=HURT)
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_damaged_record(kind, hurts):
    rows = "\n".join(f"{i * 0.01:.2f},{v}" for i, v in enumerate(VALUES))
    text = {
        "jma": lambda: written.jma_text({"NS": VALUES, "EW": -VALUES}),
        "peer": lambda: written.peer_text(VALUES / 981),
        "csmip_v1": lambda: written.csmip_v1_text({"Up": VALUES / 10000, "90 Deg": VALUES / 5000}),
        "csmip_v2": lambda: written.csmip_v2_text(VALUES),
        "knet": lambda: written.knet_text(np.round(VALUES * 100).astype(int), "0.7"),
        "esm": lambda: written.esm_text(VALUES),
        "cosmos": lambda: written.cosmos_text({"90 deg, roof": VALUES, "Up": VALUES / 2}),
        "smc": lambda: written.smc_text(VALUES),
        "zip": lambda: written.esm_text(VALUES),
        "plain": lambda: "time_s,a\ns,gal\n" + rows,
    }[kind]()
    data = zipped({"a.asc": text}) if kind == "zip" else text.encode()
    motion = outcome(damaged(data, hurts), lambda path: read_record(path, channel=1))
    if isinstance(motion, str):
        assert "file.csv" in motion
    else:
        assert np.isfinite(motion.acceleration).all()
        assert motion.peak <= 5 * 9.80665


@pytest.mark.parametrize(
    "kind", ["time_s,base,2F:1,RF\ns,g,gal,g\n", "frequency_hz,2F,RF_re,RF_im\n"]
)
@given(hurts=HURT)
@settings(max_examples=25, deadline=None)
def test_damaged_observation(kind, hurts):
    rows = "\n".join(f"{i * 0.01:.2f},{v / 100},{v},{1 + i}" for i, v in enumerate(VALUES + 60))
    data = outcome(damaged((kind + rows).encode(), hurts), read_observation_file)
    if isinstance(data, str):
        assert "file.csv" in data
    else:
        values = data.acceleration if isinstance(data, Histories) else data.log_frf
        assert np.isfinite(values).all()


@given(st.binary(max_size=300))
@settings(max_examples=50, deadline=None)
def test_any_bytes(data):
    for read in (read_record, read_observation_file):
        assert "file.csv" in str(outcome(data, read))
