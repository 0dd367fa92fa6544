"""Files of instruments and of identification programs, written by the libraries themselves."""

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from femupdate.errors import MeasurementError
from femupdate.measurement import identified_modes, read_measured
from tests.measurement import written

VALUES = np.round(1000.0 * np.sin(np.arange(200) ** 1.1)).astype(np.int32)


@pytest.fixture
def obspy():
    return pytest.importorskip("obspy")


@pytest.fixture
def trace(obspy):
    """A trace of a channel, from a time in seconds on."""

    def build(channel, start=0.0, factor=1, count=200):
        head = {"network": "XX", "station": "TWR", "channel": channel, "delta": 0.01}
        made = obspy.Trace(factor * VALUES[:count], head)
        made.stats.starttime = obspy.UTCDateTime(2026, 1, 1) + start
        return made

    return build


def test_miniseed(obspy, trace, tmp_path):
    path = tmp_path / "a.mseed"
    traces = [trace("HNE"), trace("HNZ", 0.05, 2), trace("HHN", 0.0, 3, 190)]
    obspy.Stream(traces).write(str(path), format="MSEED")
    recording = read_measured(path)
    channels = {one.name: one for one in recording.channels}
    east, up, north = (channels[f"XX.TWR..{code}"] for code in ("HNE", "HNZ", "HHN"))
    assert (east.quantity, east.direction, east.unit) == ("acceleration", "E", None)
    assert (north.quantity, up.vertical) == ("velocity", True)
    # All begin with the vertical, which begins five samples late, and end with the north.
    np.testing.assert_array_equal(east.values, VALUES[5:190])
    np.testing.assert_array_equal(up.values, 2 * VALUES[:185])
    np.testing.assert_array_equal(north.values, 3 * VALUES[5:190])
    assert recording.channels[0].done[0].startswith("Cut to the time that all channels have")


def test_sac(trace, tmp_path):
    path = tmp_path / "a.sac"
    trace("HNE").write(str(path), format="SAC")
    (channel,) = read_measured(path).channels
    np.testing.assert_allclose(channel.values, VALUES)
    assert channel.time_step == pytest.approx(0.01)


def test_accelerograph_of_kinemetrics(obspy):
    """A file that comes with ObsPy: 2.5 V of full scale, 24 bits, 1.25 to 2.5 V per g."""
    folder = Path(obspy.__file__).parent / "io" / "kinemetrics" / "tests" / "data"
    path = folder / "BI008_MEMA-04823.evt"
    if not path.exists():
        pytest.skip("this ObsPy comes without its test files")
    raw = obspy.read(path, format="KINEMETRICS_EVT")
    channels = read_measured(path).channels
    assert len(channels) == 3
    for channel, trace in zip(channels, raw, strict=True):
        constants = trace.stats.kinemetrics_evt
        volts = trace.data * constants.chan_fullscale / 2**23
        expected = volts / constants.chan_sensitivity * 9.81
        np.testing.assert_allclose(channel.values, expected, rtol=1e-5)
        assert (channel.unit, channel.quantity, channel.time_step) == (
            "m/s2",
            "acceleration",
            0.004,
        )


@pytest.mark.parametrize(
    ("starts", "words"), [((0.0, 3.0), "has a gap of 1 s"), ((0.0, 1.0), "has an overlap of 1 s")]
)
def test_a_trace_with_a_gap_is_refused(obspy, trace, tmp_path, starts, words):
    path = tmp_path / "a.mseed"
    obspy.Stream([trace("HNE", start) for start in starts]).write(str(path), format="MSEED")
    with pytest.raises(MeasurementError, match=words):
        read_measured(path)


def test_sac_is_told_by_its_content_and_gse_refused(trace, tmp_path):
    path = tmp_path / "SAC.dat"
    trace("BHE").write(str(path), format="SAC")
    (channel,) = read_measured(path).channels
    np.testing.assert_allclose(channel.values, VALUES)
    trace("BHE").write(str(path), format="GSE2")
    with pytest.raises(MeasurementError, match=r"a GSE file, .*by ObsPy to miniSEED"):
        read_measured(path)


def test_traces_that_never_meet(obspy, trace, tmp_path):
    path = tmp_path / "a.mseed"
    both = [trace("HNE"), trace("HNN", 60.0)]
    obspy.Stream(both).write(str(path), format="MSEED")
    with pytest.raises(MeasurementError, match="no time in common"):
        read_measured(path)


def test_kiknet_numbers_its_channels(tmp_path):
    """1 to 3 in the borehole and 4 to 6 on the ground, as ObsPy's reader has them."""
    text = written.knet_text(VALUES.tolist(), "2")
    line = next(line for line in text.splitlines() if line.startswith("Dir."))
    for number, direction, place in (("1", "N-S", "borehole"), ("5", "E-W", "ground surface")):
        path = tmp_path / f"{number}.knt"
        path.write_text(text.replace(line, f"Dir.              {number}"))
        (channel,) = read_measured(path).channels
        assert (channel.direction, channel.location) == (direction, place)


@pytest.fixture
def tdms(tmp_path):
    """A TDMS file of channels with their properties, by npTDMS."""
    nptdms = pytest.importorskip("nptdms")

    def build(*channels):
        path = tmp_path / "a.tdms"
        parts = [
            nptdms.ChannelObject(group, name, data, own) for group, name, data, own in channels
        ]
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment(parts)
        return path

    return build


def test_tdms(tdms):
    clock = {"wf_increment": 0.005}
    path = tdms(
        ("run", "roof", 0.001 * VALUES, {**clock, "unit_string": "g"}),
        ("run", "hammer", 2.0 * VALUES, {**clock, "unit_string": "N"}),
        ("run", "spare", 1.0 * VALUES, {}),
    )
    recording = read_measured(path)
    roof, hammer = recording.channels
    assert (roof.name, roof.unit, roof.quantity, roof.time_step) == (
        "roof",
        "g",
        "acceleration",
        0.005,
    )
    assert (hammer.quantity, hammer.unit) == ("force", "N")
    np.testing.assert_allclose(roof.values, 0.001 * VALUES)
    assert recording.notes == ("Channels without numbers or a time step: spare.",)


def test_tdms_with_a_channel_of_times(tdms):
    times = 12.5 + 0.02 * np.arange(len(VALUES))
    path = tdms(("run", "Time", times, {}), ("run", "roof", 1.0 * VALUES, {"unit_string": "g"}))
    (roof,) = read_measured(path).channels
    assert (roof.name, roof.time_step, roof.unit) == ("roof", 0.02, "g")


@pytest.mark.parametrize(
    ("module", "data", "name"),
    [("obspy", b"000001D ABC  BHZNZ" + bytes(99), "a.mseed"), ("nptdms", b"TDSm\x0e\0", "a.tdms")],
)
def test_a_missing_library_is_named(monkeypatch, tmp_path, module, data, name):
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(MeasurementError, match=r"pip install 'femupdate\[formats\]'"):
        read_measured(path)


def test_modes_of_pyoma2_as_arrays(tmp_path):
    """Fn (m,), Xi (m,) and Phi (c, m) with their standard deviations, as in its results."""
    shape = np.array([[0.3 + 0.01j, 1.0], [0.7 - 0.02j, -0.4], [1.0 + 0j, -0.7]])
    path = tmp_path / "modes.npz"
    np.savez(path, Fn=[1.5, 4.4], Xi=[0.01, 0.02], Phi=shape, Fn_std=[0.01, 0.02])
    columns = {"2F": "1", "3F": "2", "RF": "3"}
    found = identified_modes(read_measured(path), columns)
    np.testing.assert_allclose(found.frequency_hz, [1.5, 4.4])
    np.testing.assert_allclose(found.frequency_sd_hz, [0.01, 0.02])
    np.testing.assert_allclose(np.abs(found.shape), np.abs(shape).T, atol=0.02)
    assert np.isnan(found.shape_sd).all()
    np.savez(path, Fn=[1.5, 4.4], Phi=shape.T, channels=np.array(["2F", "3F", "RF"]))
    np.testing.assert_allclose(identified_modes(read_measured(path)).shape, found.shape)
    np.savez(path, Fn=[1.5, 4.4], Phi=shape, Xi=[0.01])
    with pytest.raises(MeasurementError, match="2 frequencies but 1 values of damping"):
        read_measured(path)


def test_modes_of_matlab_as_an_array_of_structures_and_as_columns(tmp_path):
    shape = np.array([[0.4, 1.0], [-1.0, 0.5]])
    modes = np.zeros(2, dtype=[("freq", "f8"), ("zeta", "f8"), ("phi", "O")])
    for k in range(2):
        modes[k] = (1.5 + 3.0 * k, 0.01, shape[k])
    scipy.io.savemat(tmp_path / "of.mat", {"mode": modes})
    table = {"Frequency": [1.5, 4.5], "Damping": [0.01, 0.01], "F2": shape[:, 0], "RF": shape[:, 1]}
    scipy.io.savemat(tmp_path / "table.mat", table)
    for name, columns in {"of.mat": {"2F": "1", "RF": "2"}, "table.mat": {"2F": "F2"}}.items():
        found = identified_modes(read_measured(tmp_path / name), columns)
        assert found.floors == ("2F", "RF")
        np.testing.assert_array_equal(found.shape, shape)
        np.testing.assert_array_equal(found.damping, [0.01, 0.01])


def test_a_pickle_is_never_opened(tmp_path):
    import pickle

    path = tmp_path / "setup.pkl"
    path.write_bytes(pickle.dumps({"Fn": [1.5]}))
    with pytest.raises(MeasurementError, match=r"a pickle of Python, which can run code.*savez"):
        read_measured(path)
