"""What cannot be read as a record is refused in one plain sentence that says where."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.errors import MeasurementError
from femupdate.measurement import (
    Histories,
    Observation,
    RecordedMode,
    channel_name,
    floor_height,
    identified_modes,
    parse_channel,
    read_measured,
    read_observation_file,
    read_record,
    write_observation_histories,
)
from femupdate.measurement.write import write_frfs, write_modes_uff
from tests.measurement import written

N = 40
VALUES = np.round(50 * np.sin(0.7 * np.arange(N)) + 0.1 * np.arange(N), 3)
TIMES = [f"{i * 0.01:.2f}" for i in range(N)]


def rows(values=VALUES, times=TIMES) -> list[str]:
    return [f"{t},{v}" for t, v in zip(times, values, strict=True)]


def plain(lines: list[str], head: str = "time_s,a\ns,gal\n") -> str:
    return head + "\n".join(lines) + "\n"


def changed(line: int, text: str) -> list[str]:
    """The good rows with another text at one line number of the file (header: lines 1 and 2)."""
    lines = rows()
    lines[line - 3] = text
    return lines


PLAIN = {
    "empty": ("", "the file is empty"),
    "header alone": ("time_s,a\n", "header but no data"),
    "nine rows": (plain(rows()[:9]), "9 values are no record"),
    "one column": ("\n".join(str(v) for v in VALUES), "one column only"),
    "no time": ("NS,EW\n" + "\n".join(f"{v},{-v}" for v in VALUES), "no column of times among NS"),
    "no time, no header": ("\n".join(f"{v},{-v}" for v in VALUES), "no column grows as times do"),
    "no unit": (plain(rows(), "time_s,a\n"), "does not say its unit; give it by the unit option"),
    "unknown unit": (plain(rows(), "time_s,a\ns,furlong\n"), "unknown unit 'furlong'"),
    "a velocity": (plain(rows(), "time_s,a (mm/s)\n"), "mm/s is a unit of velocity; give acc"),
    "unknown time unit": (plain(rows(), "time_s,a\nh,gal\n"), "unknown unit 'h' for time"),
    "short units row": (plain(rows(), "time_s,a\ns\n"), "line 2: the units row has 1 cells"),
    "hexadecimal": (plain(changed(5, "0.02,0x1F")), "'0x1F' is not a number"),
    "cut line": (plain([*rows()[:-1], "0.3"]), "line 42: the row has 1 cells where 2"),
    "gap": (plain(rows()[:20] + rows()[21:]), "line 23, column 'time_s': the sampling is not unif"),
    "repeated row": (plain(rows()[:20] + rows()[19:]), "line 23, column 'time_s': the sampling"),
    "one time wrong": (plain(changed(20, "0.175,1.0")), "the sampling is not uniform"),
    "constant": (plain(rows(np.full(N, 3.0))), "every value is the same"),
    "gal taken for m/s2": (plain(rows(2 * VALUES), "time_s,a\ns,m/s2\n"), "10.9 g when the values"),
    "g taken for gal": (plain(rows(VALUES / 98100)), "is the unit wrong?"),
    "nameless column": (plain([r + ",1" for r in rows()], "t,,a\n"), "column 2 has no name"),
    "prose": ("Dear all,\nplease find the record attached.\n", "none of the known formats"),
}


@pytest.mark.parametrize(("text", "message"), PLAIN.values(), ids=PLAIN)
def test_bad_table(write, text, message):
    with pytest.raises(MeasurementError) as caught:
        read_record(write(text, "bad.csv"))
    sentence = str(caught.value)
    assert message in sentence
    assert "bad.csv" in sentence
    assert "\n" not in sentence


def edited(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def last_line_less(text: str) -> str:
    return "\n".join(text.rstrip("\n").split("\n")[:-1]) + "\n"


HEADERED = {
    "jma without rate": ("jma", lambda t: edited(t, "SAMPLING RATE", "SOMETHING"), "SAMPLING RATE"),
    "jma rate of zero": ("jma", lambda t: edited(t, "50Hz", "0Hz"), "must be a number above zero"),
    "jma without unit": ("jma", lambda t: edited(t, " UNIT", " UNITED"), "does not give UNIT"),
    "jma without names": ("jma", lambda t: edited(t, " NS\n", ""), "row of channel names"),
    "jma without data": ("jma", lambda t: t[: t.index(" NS\n") + 4], "no data"),
    "peer too few": ("peer", last_line_less,
        "line 4: the header announces 40 values but 35 follow"),
    "peer text": ("peer", lambda t: edited(t, "E-02", "Exxx"), "is not a number"),
    "peer no count": ("peer", lambda t: edited(t, "NPTS=   40", "NPTS= many"), "NPTS is 'many'"),
    "peer zero step": ("peer", lambda t: edited(t, ".0100", "0"), "DT is '0'"),
    "peer velocity": ("peer", lambda t: edited(t, "ACCELERATION", "VELOCITY"),
        "take the .AT2 file"),
    "csmip too few": ("csmip_v1", lambda t: edited(t, "  .003231", ""),
        "line 5: the header announces 40 values in channel 180 Deg but 7 follow"),
    "csmip too many": ("csmip_v1", lambda t: edited(t, "/&", "  .000001\n/&"),
        "announces 40 values in channel 180 Deg but 41 follow"),
    "csmip cut off": ("csmip_v1", lambda t: t[: t.index("/&") - 30], "values in channel 180 Deg"),
    "csmip text": ("csmip_v1", lambda t: edited(t, ".003231", "*******"), "line 6, column 2"),
    "csmip unit": ("csmip_v1", lambda t: edited(t, "of g.", "of volt."), "unknown unit 'volt'"),
    "csmip v2 row less": ("csmip_v2", lambda t: "\n".join(t.split("\n")[:4] + t.split("\n")[5:]),
        "line 4: the header announces 40 values in channel 270 Deg, Roof - center but 32 follow"),
    "knet too few": ("knet", last_line_less, "line 12: the header announces 40 values but 32"),
    "knet no direction": ("knet", lambda t: edited(t, "Dir.", "Dxr."), "does not give Dir."),
    "knet scale 0": ("knet", lambda t: edited(t, "(gal)/", "(gal)/0*"), "'0'; it must be"),
    "knet no scale": ("knet", lambda t: edited(t, "7845(gal)/8223790", ""), "not give Scale"),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "spoil", "message"), HEADERED.values(), ids=HEADERED)
def test_bad_record_of_a_known_format(write, kind, spoil, message):
    good = {
        "jma": lambda: written.jma_text({"NS": VALUES}),
        "peer": lambda: written.peer_text(VALUES / 981),
        "csmip_v1": lambda: written.csmip_v1_text({"180 Deg": VALUES / 10000}),
        "csmip_v2": lambda: written.csmip_v2_text(VALUES),
        "knet": lambda: written.knet_text(np.round(VALUES * 100).astype(int), "0.4"),
    }[kind]()
    read_record(write(good, "good.txt"))
    with pytest.raises(MeasurementError) as caught:
        read_record(write(spoil(good), "bad.txt"))
    assert message in str(caught.value)
    assert "bad.txt" in str(caught.value)


def test_missing_file_folder_and_workbook(write, tmp_path):
    with pytest.raises(MeasurementError, match="no such file"):
        read_record(tmp_path / "kobe.csv")
    with pytest.raises(MeasurementError, match="is a folder"):
        read_record(tmp_path)
    with pytest.raises(MeasurementError, match="export it as CSV"):
        read_record(write(b"PK\x03\x04rest", "book.xlsx"))
    with pytest.raises(MeasurementError, match="not a text file"):
        read_record(write(b"1.0,2.0\n\x00\x01\x02", "binary.dat"))


def test_unit_against_the_file_is_refused_and_the_same_unit_accepted(write):
    path = write(plain(rows()))
    with pytest.raises(MeasurementError, match="the file says gal but the unit option says g;"):
        read_record(path, unit="g")
    assert read_record(path, unit="cm/s2").peak > 0.0
    with pytest.raises(MeasurementError, match="unknown unit 'cubit'"):
        read_record(path, unit="cubit")


def test_channels_are_listed_with_their_peaks(write):
    path = write(written.csmip_v1_text({" 90 Deg": VALUES / 981, "360 Deg": -VALUES / 500}))
    with pytest.raises(MeasurementError) as caught:
        read_record(path)
    peak = np.abs(VALUES).max()
    for part in ("choose one", "1 = 90 Deg", "2 = 360 Deg", f"{peak / 500 * 9.80665:.4g}"):
        assert part in str(caught.value)


@pytest.mark.parametrize("channel", ["North", 0, 3, "-1", "", "Deg"])
def test_channel_that_is_not_there(write, channel):
    path = write(written.csmip_v1_text({" 90 Deg": VALUES / 981, "360 Deg": -VALUES / 500}))
    with pytest.raises(MeasurementError, match=r"there is no channel .* choose by number: 1 = 90"):
        read_record(path, channel=channel)


def test_channel_name_that_two_bear(write):
    path = write(written.csmip_v1_text({"90 Deg": VALUES / 981, "90 Deg ": -VALUES / 500}))
    with pytest.raises(MeasurementError, match="2 channels are called '90 deg'"):
        read_record(path, channel="90 deg")


def test_wide_table_lists_peaks_without_a_unit(write):
    path = write("time,NS,EW\n" + "\n".join(r + ",7" for r in rows()))
    with pytest.raises(MeasurementError, match=r"2 = EW \(peak 7 in its own unit"):
        read_record(path)


@pytest.mark.parametrize("step", [1e-9, 1e6])
def test_a_time_step_with_which_nothing_is_measured(write, step):
    text = written.peer_text(VALUES / 981.0, step=f"{step:g}")
    with pytest.raises(MeasurementError, match=r"the time step is 1e.* is the time's unit wrong\?"):
        read_record(write(text, "r.at2"))
    times = [f"{k * step:.12g}" for k in range(N)]
    with pytest.raises(MeasurementError, match="the time step is"):
        read_record(write(plain(rows(times=times)), "r.csv"))


def sample(time_step: float = 1 / 120, count: int = 500) -> Histories:
    channels = tuple(parse_channel(n) for n in ("base", "RF:1", "RF:2.y", "2F"))
    values = np.random.default_rng(3).normal(size=(4, count)) * [[1], [3], [1e-4], [0.1]]
    return Histories(time_step, channels, values, "made.csv")


@given(rate=st.sampled_from([50, 100, 120, 128, 200, 256, 1000, 1024]), count=st.integers(64, 400))
@settings(max_examples=20, deadline=None)
def test_histories_round_trip(tmp_path_factory, rate, count):
    data = sample(1 / rate, count)
    path = write_observation_histories(tmp_path_factory.mktemp("w") / "made.csv", data)
    back = read_observation_file(path)
    assert back.time_step == data.time_step
    assert back.channels == data.channels
    # Nine significant digits are written.
    np.testing.assert_allclose(back.acceleration, data.acceleration, rtol=5e-9)


@pytest.mark.parametrize("direction", ["x", "y"])
def test_shapes_are_read_back_from_a_universal_file(tmp_path, direction):
    pytest.importorskip("pyuff", reason="pyuff (extra `formats`) is not installed")
    shapes = np.array([[0.3, -0.017, 1.0], [1.0, 0.25, -0.8]])
    modes = [
        RecordedMode(
            frequency_hz=1.5 * k, sensors=("2F", "3F", "RF"), shape=shape, damping=0.02, name=str(k)
        )
        for k, shape in enumerate(shapes, 1)
    ]
    path = write_modes_uff(tmp_path / "shapes.uff", modes, (3.0, 6.0, 9.0), direction)
    points = {f: f"point {k} +{direction.upper()}" for k, f in enumerate(("2F", "3F", "RF"), 1)}
    back = identified_modes(read_measured(path), points)
    np.testing.assert_allclose(back.shape, shapes, rtol=1e-5)
    np.testing.assert_allclose(back.frequency_hz, [1.5, 3.0], rtol=1e-5)
    np.testing.assert_allclose(back.damping, 0.02)


@pytest.mark.parametrize("phases", [True, False])
def test_arrays_of_responses_round_trip(tmp_path, phases):
    grid, rng = np.linspace(0.5, 5.0, 40), np.random.default_rng(0)
    h = rng.normal(size=(2, 40)) + 1j * rng.normal(size=(2, 40))
    h = h if phases else np.abs(h)
    seen = Observation.from_arrays(grid, {"RF": h[1], "2F": h[0]}, 0.03)
    back = read_observation_file(write_frfs(tmp_path / "h.csv", seen))
    assert back.floors == ("2F", "RF")
    np.testing.assert_allclose(back.log_frf, np.log(np.abs(h)), atol=1e-8)
    np.testing.assert_allclose(back.noise_sd, 0.03)
    assert (back.phase is not None) == phases
    if phases:
        np.testing.assert_allclose(back.phase, np.angle(h), atol=1e-7)


@pytest.mark.parametrize(
    "columns", [{"attic": [1.0, 2.0]}, {"base": [1.0, 2.0]}, {"RF": [1.0]}, {"RF": [0.0, 1.0]}, {}]
)
def test_arrays_that_are_no_responses_are_refused(columns):
    with pytest.raises(MeasurementError, match=r"^arrays: .*; (give|sort)"):
        Observation.from_arrays([1.0, 1.1], columns)


def test_label_and_units_stand_above_the_numbers(tmp_path):
    path = write_observation_histories(
        tmp_path / "a.csv", sample(), ("Simulated, not measured.", "Two\nlines.")
    )
    assert path.read_text().split("\n")[:5] == [
        "# Simulated, not measured.",
        "# Two",
        "# lines.",
        "time_s,base,RF:1,RF:2.y,2F",
        "s,m/s2,m/s2,m/s2,m/s2",
    ]


@pytest.mark.parametrize("name", ["base", "2F", "10F:west", "RF.y", "base:1.z", "3F:2"])
def test_column_names_round_trip(name):
    channel = parse_channel(name)
    assert channel.name == name
    assert channel_name(channel.floor, channel.sensor, channel.direction) == name


@pytest.mark.parametrize(
    "name", ["", "1F", "0F", "F", "roof", "2F.w", "2F:", "2F:1:2", "B1F", "2F "]
)
def test_what_is_no_column_name(name):
    assert parse_channel(name) is None or name.strip() == "2F"


def test_floors_sort_from_bottom_to_top():
    assert sorted(["RF", "10F", "2F", "base"], key=floor_height) == ["base", "2F", "10F", "RF"]
