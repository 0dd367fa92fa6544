"""What mutated files have shown: files that crashed a library, took minutes or overflowed."""

import contextlib
import struct
import time

import numpy as np
import pytest
from scipy.io import savemat

from femupdate.errors import MeasurementError
from femupdate.measurement.cells import split_complex
from femupdate.measurement.inspection import inspect_file
from femupdate.measurement.kinds import Reading, read_any_kind
from femupdate.measurement.quantity import bracketed
from femupdate.measurement.readers import uff
from femupdate.measurement.readers.seismic import gse_samples
from femupdate.measurement.registry import read_measured
from femupdate.measurement.text import TextFile
from femupdate.workflow.identify import identify

# Written by hand after the format: 5, 5 + 7, 5 + 7 - 20 and so on are sums of second differences.
GSE = b"""\
WID2 2026/01/01 00:00:00.000 TWR   BHE      CM6        3  100.000000   1.00e+00   1.000
STA2           -999.0000 -999.00000              -.999 -.999
DAT2
53ZI
CHK2       %d
"""


def test_packed_samples_by_hand():
    """Characters carry 4 or 5 bits, and say by bit 5 that more follow, by bit 4 a minus."""
    letters = "+-0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
    # Second differences 5, -3 and 40 = 1 * 32 + 8: the samples are 5, 7 and 49.
    packed = "".join(letters[code] for code in (5, 16 + 3, 32 + 1, 8)).encode()
    text = GSE.replace(b"53ZI", packed) % 61
    assert gse_samples(text, [("CM6", 3)])[0].tolist() == [5.0, 7.0, 49.0]
    plain = text.replace(packed, b"5 7\n49")
    assert gse_samples(plain, [("INT", 3)])[0].tolist() == [5.0, 7.0, 49.0]
    for wrong, kinds, message in (
        (text, [("CM6", 4)], "3 samples where the header says 4"),
        (GSE.replace(b"53ZI", packed) % 62, [("CM6", 3)], "the sum of its samples"),
        (GSE.replace(b"53ZI", packed[:-1]) % 61, [("CM6", 3)], "packed samples are damaged"),
        (text[:-20], [("CM6", 3)], "1 headers, but 0 whole sections"),
        (text, [("CM8", 3)], "type CM8 are not supported"),
    ):
        with pytest.raises(ValueError, match=message):
            gse_samples(wrong, kinds)


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.9])
def test_a_gse_file_that_is_cut_is_refused(tmp_path, keep):
    """ObsPy's library ends the process."""
    obspy = pytest.importorskip("obspy")
    path = tmp_path / "a.gse"
    values = np.round(1000.0 * np.sin(np.arange(400) ** 1.1)).astype(np.int32)
    obspy.Trace(values, {"station": "TWR", "channel": "BHE"}).write(str(path), format="GSE2")
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(MeasurementError, match="GSE2 file cannot be read"):
        read_measured(path)


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


def test_packed_matlab_arrays_that_fill_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("femupdate.measurement.readers.mat._LARGEST_BYTES", 1_000_000)
    path = tmp_path / "a.mat"
    savemat(path, {"base": np.zeros(1_000_000)}, do_compression=True)
    assert path.stat().st_size < 10_000
    with pytest.raises(MeasurementError, match="unpack to more"):
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
        read_any_kind(path, Reading())
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
        read_any_kind(write(forced, "hammer.csv"), Reading())
    moving = f"time_s,2F (m/s2),RF (m/s2)\n{rows}8.00,1e300,0\n"
    with pytest.raises(MeasurementError, match="holds values above 1e\\+09"):
        identify(write(moving, "ambient.csv"), tmp_path / "modes.csv")


def test_modes_of_any_scale_and_of_no_frequency(write):
    """Scales of a shape mean nothing; a negative frequency is a finding, not a failure."""
    head = "mode,frequency_hz,damping,2F,RF\n"
    large = read_any_kind(write(f"{head}1,2,0.01,1e300+1e298j,-2e300\n", "a.csv"), Reading())
    small = read_any_kind(write(f"{head}1,2,0.01,1+0.01j,-2\n", "b.csv"), Reading())
    np.testing.assert_allclose(large.shape / large.shape[0, 0], small.shape / small.shape[0, 0])
    wrong = write(f"{head}1,-2,0.01,1,2\n2,2,0.01,1,-2\n", "c.csv")
    assert inspect_file(wrong).summary


def test_functions_with_fewer_values_than_frequencies(tmp_path):
    one = {"func_type": 4, "x": np.arange(128.0), "data": np.ones(127)}
    with pytest.raises(MeasurementError, match="127 values at 128 frequencies"):
        uff._function(TextFile(tmp_path / "a.uff"), one, True)


def test_a_mode_without_components_at_a_point(tmp_path):
    one = {"type": 55, "analysis_type": 2, "node_nums": [1, 2, 3], "mode_n": 4}
    one |= {"freq": 1.5, "modal_damp_vis": 0.01, "r1": np.ones(2)}
    with pytest.raises(MeasurementError, match="mode 4 has 2 components where its points have 3"):
        list(uff._modes(TextFile(tmp_path / "a.uff"), [one]))
