"""MATLAB and numpy files as the tables that their arrays make."""

import zipfile

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from femupdate.errors import MeasurementError
from femupdate.measurement import inspect_file, read_measured, read_observation_file, read_record

RATE = 200.0
ROWS = np.random.default_rng(3).normal(size=(3, 90)) * [[1.0], [2.0], [4.0]]
TIME = np.arange(90) / RATE
WAVE, STEPS = np.random.default_rng(4).normal(size=1200), np.arange(1200) / 100.0


def save_7_3(path, arrays):
    """As MATLAB -v7.3 does: HDF5 behind a block of 512 bytes, scalars as 1 x 1."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in arrays.items():
            file[name] = np.atleast_2d(value)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, made by a test".ljust(512))
    return path


def save(path, arrays):
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        savemat(path, arrays)
    return path


WRITERS = {"a.mat": save, "b.mat": save_7_3, "c.npz": save}


@pytest.mark.parametrize(("name", "write"), WRITERS.items(), ids=WRITERS)
def test_channels_with_their_times_are_an_observation(tmp_path, name, write):
    arrays = {"time": TIME, "base": ROWS[0], "a2": ROWS[1], "RF": ROWS[2]}
    data = read_observation_file(
        write(tmp_path / name, arrays), "m/s2", {"2F": "a2", "base": "base", "RF": "RF"}
    )
    assert data.time_step == 1 / RATE
    by_name = dict(zip((c.name for c in data.channels), data.acceleration, strict=True))
    np.testing.assert_array_equal([by_name[n] for n in ("base", "2F", "RF")], ROWS)


@pytest.mark.parametrize(("name", "write"), WRITERS.items(), ids=WRITERS)
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    "rate", [{"fs": RATE}, {"dt": 1 / RATE}, {"SamplingRate": RATE}, {"SampleFrequency": RATE}]
)
def test_one_array_of_all_channels_with_a_rate(tmp_path, name, write, turned, rate):
    arrays = {"acc": ROWS.T if turned else ROWS, **rate}
    path = write(tmp_path / name, arrays)
    motion = read_record(path, "m/s2", "acc_2")
    assert motion.time_step == 1 / RATE
    assert [one.name for one in read_measured(path).histories()] == ["acc_1", "acc_2", "acc_3"]
    np.testing.assert_array_equal(motion.acceleration, ROWS[1])


def test_structures_and_a_unit(tmp_path):
    arrays = {"test": {"fs": RATE, "acc": ROWS, "place": "roof"}, "unit": "gal", "n": 7.0}
    motion = read_record(save(tmp_path / "s.mat", arrays), channel="acc_3")
    np.testing.assert_allclose(motion.acceleration, ROWS[2] / 100, rtol=1e-14)


def exported(values, unit, names, label="s", step=1 / RATE):
    """A structure as Simcenter Testlab exports it."""
    count = float(len(values))
    x = {"start_value": 0.0, "increment": step, "number_of_values": count}
    return {
        "x_values": {**x, "quantity": {"label": label}},
        "y_values": {"values": values, "quantity": {"label": unit}},
        "function_record": {"name": np.array(names, dtype=object)},
    }


def test_signals_of_testlab(tmp_path):
    pushed = exported(ROWS[2], "N", "hammer")
    signals = {"Signal_0": exported(ROWS[:2].T, "g", ["P1:+X", "P2:+X"]), "Signal_1": pushed}
    path = save(tmp_path / "t.mat", signals)
    table = read_measured(path).table
    assert table.names == ("time_s", "P1:+X", "P2:+X", "hammer")
    assert table.units == (None, "g", "g", "N")
    np.testing.assert_array_equal(table.values[:, 1:].T, ROWS)
    np.testing.assert_allclose(table.values[:, 0], TIME)
    assert [each.quantity for each in read_measured(path).histories()][-1] == "force"
    other = save(tmp_path / "u.mat", {**signals, "S": exported(ROWS[2], "N", "h", step=0.1)})
    with pytest.raises(MeasurementError, match="Signal_0, Signal_1 are not sampled alike"):
        read_measured(other)
    orders = save(tmp_path / "v.mat", {"S": exported(ROWS[0], "g", "a", "rpm")})
    with pytest.raises(MeasurementError, match="S holds no 90 rows of finite numbers over time"):
        read_measured(orders)


def test_response_functions_of_testlab(tmp_path):
    h = ROWS[:2].T + 1j * ROWS[1:].T
    frf = exported(h, "(m/s^2)/N", ["same", "same"], "Hz", 0.1)
    table = read_measured(save(tmp_path / "f.mat", {"FRF": frf})).table
    assert table.names == ("frequency_hz", "FRF_1_re", "FRF_1_im", "FRF_2_re", "FRF_2_im")
    assert set(table.units[1:]) == {"(m/s^2)/N"}
    np.testing.assert_array_equal(table.values[:, 3] + 1j * table.values[:, 4], h[:, 1])


def test_complex_response_functions(tmp_path):
    h = ROWS[1] + 1j * ROWS[2]
    path = save(tmp_path / "h.npz", {"freq": np.arange(1, 91) * 0.1, "RF": h})
    table = read_observation_file(path)
    np.testing.assert_allclose(np.exp(table.log_frf + 1j * table.phase), [h])
    np.testing.assert_allclose(table.frequency_hz[[0, -1]], [0.1, 9.0])


def test_a_rate_that_arrays_lack_is_said(tmp_path):
    path = save(tmp_path / "bare.npz", {"data": ROWS})
    columns = {"time_s": "200 Hz", "base": "data_1", "2F": "data_2", "RF": "3"}
    read = read_observation_file(path, "m/s2", columns)
    np.testing.assert_array_equal(read.acceleration, ROWS)


def spoiled(values, at):
    values = values.copy()
    values[at] = np.nan
    return values


BAD = {
    "no rate": ({"acc": ROWS}, "no column of times among acc_1, acc_2, acc_3; call it time_s, or"),
    "rate of zero": ({"acc": ROWS, "fs": 0.0}, "or give the rate: --rate 200"),
    "three axes": ({"fs": RATE, "RF": np.zeros((9, 8, 3))}, "RF has axes of (9, 8, 3); save a row"),
    "complex": (
        {"fs": RATE, "RF": ROWS[0] + 1j},
        "need their frequencies, frequency_hz; histories",
    ),
    "text alone": ({"note": "none"}, "holds no array of numbers"),
    "texts": ({"fs": RATE, "acc": np.array(["a"] * 90)}, "holds no array of numbers"),
    "nan": ({"fs": RATE, "acc": spoiled(ROWS[0], 41)}, "row 42, column 'acc': the cell is blank"),
    "gap": ({"time": np.delete(TIME, 30), "acc": ROWS[0, 1:]}, "row 31, column 'time_s': the sam"),
    "818 g": ({"fs": RATE, "acc": ROWS[0] * 1e4}, "is the unit wrong?"),
}


@pytest.mark.parametrize("name", ["bad.mat", "bad.npz"])
@pytest.mark.parametrize(("arrays", "message"), BAD.values(), ids=BAD)
def test_bad_arrays(tmp_path, name, arrays, message):
    with pytest.raises(MeasurementError) as caught:
        read_record(save(tmp_path / name, arrays), "m/s2")
    assert message in str(caught.value)
    assert name in str(caught.value)


class Harmful:
    def __reduce__(self):
        return (pytest.fail, ("the pickle was opened",))


def test_pickles_are_never_opened(tmp_path):
    path = tmp_path / "p.npz"
    np.savez(path, fs=RATE, acc=np.array([Harmful(), 1], dtype=object))
    with pytest.raises(MeasurementError, match=r"acc\.npy holds Python objects, which could run"):
        read_record(path)


def test_array_larger_than_its_file(tmp_path):
    path = tmp_path / "z.npz"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    header = header.ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        data = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(800)
        archive.writestr("acc.npy", data)
    with pytest.raises(MeasurementError, match=r"acc\.npy claims 8e\+03 GB and holds"):
        read_record(path)


@pytest.mark.parametrize("name", ["cut.mat", "cut.npz", "cut7.mat"])
def test_file_cut_off(tmp_path, name):
    write = save_7_3 if "7" in name else save
    path = write(tmp_path / name, {"fs": RATE, "acc": np.tile(ROWS, 50)})
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(MeasurementError, match=r"again from its source|save the channels alone"):
        read_record(path)


@pytest.mark.parametrize(
    "said",
    [
        {"fs": 100.0, "start_base": 0.0, "start_RF": 0.5},
        {"fs": 100.0, "t0_base": 3.0, "t0_RF": 3.5},
        {"dt": 0.01, "start_base": "2024-01-01 10:00:00.0", "start_RF": "2024-01-01 10:00:00.5"},
        {"t_base": STEPS, "t_RF": STEPS[50:]},
        {"fs_base": 100.0, "fs_RF": 100.0, "start_base": 0.0, "start_RF": 0.5},
    ],
)
def test_arrays_that_start_apart_are_cut_to_their_common_time(said, tmp_path):
    path = tmp_path / "apart.mat"
    savemat(path, {"base": WAVE, "RF": WAVE[50:], **said})
    base, roof = inspect_file(path).channels
    assert base.channel.values == pytest.approx(roof.channel.values)
    assert base.channel.values.size == WAVE.size - 50


def test_arrays_of_unlike_lengths_without_starts_are_refused(tmp_path):
    path = tmp_path / "unlike.mat"
    for roof in (WAVE[50:], WAVE[:2]):
        savemat(path, {"fs": 100.0, "base": WAVE, "RF": roof})
        with pytest.raises(MeasurementError, match="RF and base have unlike lengths"):
            inspect_file(path)
    savemat(path, {"fs": 50.0, "dt": 0.01, "base": WAVE, "RF": WAVE})
    with pytest.raises(MeasurementError, match=r"fs says 0\.02 s and dt says 0\.01 s"):
        inspect_file(path)


def test_structures_with_their_own_rates_are_told(tmp_path):
    path = tmp_path / "rates.mat"
    fast, slow = {"acc": WAVE, "fs": 100.0}, {"acc": WAVE[::2], "fs": 50.0}
    savemat(path, {"base": fast, "roof": slow})
    found = inspect_file(path)
    assert "unlike rates, 100 Hz (base), 50 Hz (roof)" in found.all_findings[-1]
    assert "--columns base=1,RF=2" in found.step.command


def test_times_named_in_milliseconds_are(tmp_path):
    path = tmp_path / "ms.mat"
    savemat(path, {"time_ms": 1000.0 * STEPS, "base": WAVE, "RF": WAVE})
    assert inspect_file(path).channels[0].channel.time_step == pytest.approx(0.01)
