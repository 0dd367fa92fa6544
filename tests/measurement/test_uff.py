"""Universal files, genuine ones of pyuff and written ones; other formats refused by their names."""

import sys

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import inspect_file, read_measured, read_observation_file, read_record
from femupdate.units import STANDARD_GRAVITY
from tests.measurement import written


@pytest.fixture
def pyuff():
    return pytest.importorskip("pyuff", reason="pyuff (extra `formats`) is not installed")


def test_binary_history(pyuff, shared_file):
    (channel,) = read_measured(shared_file("formats/binary8byte.uff")).channels
    assert (channel.name, channel.unit, channel.quantity) == ("sine 5 Hz", "g", "acceleration")
    assert (channel.values.size, channel.time_step, channel.location) == (250, 0.01, "point 1")
    # What its name says.
    time = np.arange(250) * 0.01
    peak = np.abs(channel.values).max()
    turned = np.exp(-2j * np.pi * 5.0 * time) @ channel.values * 2 / 250
    assert abs(turned) == pytest.approx(peak, rel=1e-2)
    motion = read_record(shared_file("formats/binary8byte.uff"))
    np.testing.assert_allclose(motion.acceleration, channel.values * 9.80665, rtol=1e-14)


def test_functions(pyuff, shared_file):
    (h,) = read_measured(shared_file("formats/non_ascii_header.uff")).functions
    assert (h.kind, h.unit) == ("frequency response", "(1/N)*(m/s²)")
    assert h.values[1] == pytest.approx(-5.99924e-02 - 5.53260e-02j)
    assert h.frequency_hz[5] == pytest.approx(5 * 0.195313)
    (psd,) = read_measured(shared_file("formats/sample_dataset58_psd.uff")).functions
    assert (psd.kind, psd.unit, psd.values.shape) == ("power spectral density", "g²/Hz", (3201,))
    assert psd.values.dtype == np.float64


UNITS = {
    "labels": ((12, "m/s^2"), (13, "N"), "m/s^2/N"),
    "in g": ((12, "g"), (13, "N"), "g/N"),
    "mobility": ((11, "m/s"), (13, "N"), "m/s/N"),
    "whole in the numerator": ((12, "(1/N)*(m/s^2)"), (13, "N"), "(1/N)*(m/s^2)"),
    "of the format": ((8, "NONE"), (13, "NONE"), "m/N"),
    "ratio": ((12, "g"), (12, "g"), "1"),
    "nothing said": ((0, "NONE"), (0, "NONE"), None),
}


@pytest.mark.parametrize(("above", "below", "unit"), UNITS.values(), ids=UNITS)
def test_unit_of_a_response_is_that_of_its_numerator_over_its_denominator(
    pyuff, tmp_path, above, below, unit
):
    path = tmp_path / "h.uff"
    data = pyuff.prepare_58(
        binary=0,
        func_type=4,
        rsp_node=3,
        rsp_dir=1,
        ref_node=7,
        ref_dir=1,
        data=np.arange(5) * (1 + 2j),
        x=np.arange(5.0),
        id1="H",
        rsp_ent_name="a",
        ref_ent_name="b",
        abscissa_spacing=1,
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=above[0],
        orddenom_spec_data_type=below[0],
    )
    data |= {"ordinate_axis_units_lab": above[1], "orddenom_axis_units_lab": below[1]}
    pyuff.UFF(str(path)).write_sets(data, "add")
    (h,) = read_measured(path).functions
    assert (h.unit, h.response, h.reference) == (unit, "point 3 +X", "point 7 +X")


@pytest.mark.parametrize(
    ("at", "columns"), [("RF", "2F/RF=1,RF/RF=2"), ("base", "2F=1,RF=2"), ("b", "2F/RF=NUMBER")]
)
def test_floors_are_told_by_the_names_of_points(pyuff, tmp_path, at, columns):
    path = tmp_path / "h.uff"
    for node, floor in enumerate(("2F", "RF"), 1):
        data = pyuff.prepare_58(
            binary=0, func_type=4, rsp_node=node, rsp_dir=1, ref_node=2, ref_dir=1,
            data=np.arange(5) * (1 + 2j), x=np.arange(5.0), rsp_ent_name=floor,
            ref_ent_name=at, abscissa_spacing=1, abscissa_spec_data_type=18,
            ordinate_spec_data_type=12, orddenom_spec_data_type=13,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(data, "add")
    assert inspect_file(path).step.command.endswith(f"h.uff --columns {columns}")


def test_modes(pyuff, shared_file):
    modes = read_measured(shared_file("formats/uff55_translation.uff")).modes
    assert [mode.frequency_hz for mode in modes] == [10.0, 12.0, 13.0]
    assert modes[0].sensors[:4] == ("point 1 +X", "point 1 +Y", "point 1 +Z", "point 2 +X")
    np.testing.assert_allclose(modes[0].shape[1::3], [-1.46518, 0.150162, -0.376396, 0.724863])
    assert modes[0].damping is None


# pyuff leaves its own file open when it writes numbers in binary.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
def test_written_histories_are_an_observation(pyuff, tmp_path, binary):
    path = tmp_path / "made.uff"
    rows = np.random.default_rng(2).normal(size=(2, 128))
    for node, row in enumerate(rows, start=1):
        one = pyuff.prepare_58(
            binary=binary, func_type=1, rsp_node=node, rsp_dir=2, ref_dir=0, ref_node=0,
            data=row, x=np.arange(128) * 0.005, ord_data_type=4, num_pts=128,
            abscissa_spec_data_type=17, abscissa_inc=0.005, abscissa_spacing=1, abscissa_min=0.0,
            ordinate_spec_data_type=12, ordinate_axis_units_lab="m/s2", orddenom_spec_data_type=0,
            z_axis_spec_data_type=0, z_axis_value=0.0,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(one, "add")
    data = read_observation_file(path, columns={"base": "point 1 +Y", "RF": "2"})
    assert data.time_step == 0.005
    # Text of single precision has six digits.
    np.testing.assert_allclose(data.acceleration, rows, rtol=2e-5, atol=1e-6)


def test_damaged(pyuff, shared_file, write):
    data = shared_file("formats/binary8byte.uff").read_bytes()
    for cut in (100, 500, 900, 2000):
        path = write(data[:cut], "cut.uff")
        with pytest.raises(MeasurementError, match=r"cut\.uff: "):
            read_measured(path)


def test_without_pyuff(write, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    path = write("    -1\n    58\nNONE\n", "a.uff")
    with pytest.raises(MeasurementError, match=r"not installed; install it with .*\[formats\]"):
        read_measured(path)


@pytest.mark.parametrize(
    ("data", "name", "message"),
    [
        (b"MS\x03\0\0", "a.mseed3", "this is miniSEED 3, which is not read here"),
        (b"\x89HDF\r\n\x1a\n\0\0", "a.h5", "an HDF5 file"),
        (b"\x93NUMPY\x01\0v\0{'descr'", "a.npy", "save all channels with their times as .npz"),
        (b"RIFF\x24\0\0\0WAVEfmt ", "a.wav", "a sound file"),
        (
            b"Uncorrected accelerogram 20160214_001343_NBLC_20 GNS Science\nSite NBLC\n",
            "20160214_001343_NBLC_20.V1A",
            "a GeoNet accelerogram (V1A or V2A)",
        ),
        (b"Corrected accelerogram 1994 GNS Science\n", "a.V2A", "to CSV"),
        (b"LabVIEW Measurement\t\nWriter_Version\t2\n", "a.lvm", "export it as TDMS or CSV"),
        (b"BZh91AY&SY\0", "a.v2.bz2", "a file packed by bzip2"),
        (b"* VOL1DS FILE:  5522/01\nInst Type = SSA-2\n", "5522-1.V1", "a BHRC accelerogram"),
        (b"%PDF-1.7\n\0", "a.pdf", "a PDF"),
        (b"\0\0\x01\x02" * 90, "a.gcf", "a Güralp file"),
        (b"Response and Fourier amplitude spectra (68 periods)\n", "a.v3", "take the .V2 file"),
        (b"<!DOCTYPE html><html>Log in</html>\n", "a.csv", "download the data file itself"),
        (b'name = "x"\nkind = "frame"\n', "b.toml", "run `femupdate build-model` on it"),
    ],
)
def test_known_formats_that_are_not_supported(write, data, name, message):
    with pytest.raises(MeasurementError) as caught:
        read_record(write(data, name))
    assert message in str(caught.value)
    assert "which is not read here" in str(caught.value)


WAVES = np.round(np.random.default_rng(5).normal(size=(3, 80)) * 0.05, 6)


@pytest.fixture
def station(write):
    names = ("90 Deg, ground", "90 Deg, roof", "Up")
    return write(written.csmip_v1_text(dict(zip(names, WAVES, strict=True))), "station.v1")


def test_channels_by_number_and_name(station):
    data = read_observation_file(station, columns={"RF:1": "2", "base": "90 Deg, ground"})
    assert [c.name for c in data.channels] == ["RF:1", "base"]
    assert (data.time_step, data.source) == (0.01, "station.v1")
    np.testing.assert_allclose(data.acceleration, WAVES[[1, 0]] * STANDARD_GRAVITY, rtol=1e-14)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (None, r"does not say which floors .* base=1,RF=2; .*3 = Up \(peak"),
        ({"base": "1", "RF": "7"}, "there is no channel '7' to take for RF; choose by number: 1 ="),
        ({"base": "90 Deg", "RF": "2"}, "2 channels are called '90 Deg'; choose by number"),
        ({"base": "1", "roof": "2"}, "unknown column 'roof'"),
        ({"base": "1", "RF": "1"}, "'1' is mapped twice"),
        ({"base": "1", "RF": "2", "rf": "3"}, "'rf' is there twice"),
        ({"2F": "1", "RF": "2"}, "there is no column base"),
        ({"base": "1"}, "there is no floor beside the base"),
    ],
)
def test_bad_mapping(station, columns, message):
    with pytest.raises(MeasurementError, match=message):
        read_observation_file(station, columns=columns)


def test_channels_of_other_length_and_short_ones(write):
    channels = {"S": WAVES[0], "N": WAVES[1, :70], "E": WAVES[2, :63], "W": -WAVES[2, :63]}
    path = write(written.csmip_v1_text(channels), "a.v1")
    with pytest.raises(MeasurementError, match=r"'N' has 70 values every 0.01 s, 'S' 80 every"):
        read_observation_file(path, columns={"base": "S", "RF": "N"})
    with pytest.raises(MeasurementError, match="63 rows are too short for a spectrum"):
        read_observation_file(path, columns={"base": "E", "RF": "W"})
