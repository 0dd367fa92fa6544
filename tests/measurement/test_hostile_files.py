"""What mutated files have shown: files that crashed a library, took minutes or overflowed."""

import contextlib
import struct
import time

import numpy as np
import pytest
from scipy.io import savemat

from femupdate.errors import MeasurementError
from femupdate.measurement import TextFile, inspect_file, kind_in, read_measured
from femupdate.measurement.names import bracketed
from femupdate.measurement.readers import uff
from femupdate.measurement.table import split_complex
from femupdate.workflow.inspect_files import identify


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
