"""Variants of the formats that stations, programs and loggers write, each after a genuine file."""

import re

import numpy as np
import pytest
from scipy.io import savemat

from femupdate.errors import MeasurementError
from femupdate.measurement import (
    identified_modes,
    inspect_file,
    read_measured,
    read_observation_file,
)

TIME = np.arange(64) * 0.01
WAVE = np.round(10.0 * np.exp(-2.0 * TIME) * np.sin(19.0 * TIME + 0.3), 5)


def in_columns(values, form="10.5f", each=8):
    cells = [f"{value:{form}}" for value in values]
    return ["".join(cells[k : k + each]) for k in range(0, len(cells), each)]


def written(tmp_path, lines, name="file.txt", encoding="latin-1", ends="\n"):
    path = tmp_path / name
    path.write_bytes((ends.join(lines) + ends).encode(encoding))
    return path


VOLUME_2 = [
    "Corrected accelerogram   89146-L2500-12044.02       Chan  1: 360 Deg     from",
    "Station No. NaN     40.941S, 123.633W      Etna  s/n 2500  (3 Chns of  3 at Sta)",
    "Chan  1: 360 Deg",
    "Peak acceleration =     9.280    cm/sec/sec  at    0.085   sec.",
]
POINTS = "    64 points of accel data equally spaced at  .010 sec"
CSMIP = {
    "no format": (f"{POINTS}, in cm/sec2.", in_columns(WAVE), "cm/sec2"),
    "no unit": (f"{POINTS.upper()}.", in_columns(WAVE), "cm/s2"),
    "exponents": (f"{POINTS}, in cm/sec2. (8e12.5)", in_columns(WAVE, "12.5e"), "cm/sec2"),
    "repeated group": (f"{POINTS}, in g. (8(f10.5))", in_columns(WAVE), "g"),
    "free numbers": (
        f"{POINTS}, in cm/sec2. (8f10.5)",
        [" ".join(f"{v:.5f}" for v in WAVE[k : k + 8]) for k in range(0, 64, 8)],
        "cm/sec2",
    ),
}


@pytest.mark.parametrize("ends", ["\n", "   \r\n"])
@pytest.mark.parametrize(("announced", "rows", "unit"), CSMIP.values(), ids=CSMIP)
def test_csmip(tmp_path, announced, rows, unit, ends):
    path = written(tmp_path, [*VOLUME_2, announced, *rows], ends=ends)
    (channel,) = read_measured(path).channels
    np.testing.assert_allclose(channel.values, WAVE, rtol=0, atol=1e-5)
    assert (channel.unit, channel.time_step, channel.azimuth_deg) == (unit, 0.01, 0.0)
    assert channel.stated_peak == 9.28


def test_pairs_as_they_were_digitised_are_refused(tmp_path):
    pairs = [f"{a:7.3f}{b:7.3f}" for a, b in zip(TIME, WAVE, strict=True)]
    path = written(tmp_path, ["UNCORRECTED ACCELEROGRAM DATA    PROCESSED: 02/08/94", *pairs])
    with pytest.raises(MeasurementError, match=r"raw pairs of times and values.*take the \.V1"):
        read_measured(path)


def cosmos(tmp_path, channel, announced, rows, azimuth=-999, code="", real=()):
    whole, numbers = [-999] * 100, [-999.0] * 100
    whole[53] = azimuth
    for item, value in {62: 10.0, **dict(real)}.items():
        numbers[item - 1] = value
    head = [
        "Corrected acceleration    (Format v01.20 with 13 text lines)",
        channel,
        " 100 Integer-header values follow on  10 lines, Format= (10I8)",
        *in_columns(whole, "8d", 10),
        " 100 Real-header values follow on  20 lines, Format= (5F15.6)",
        *in_columns(numbers, "15.6f", 5),
        '   1 Comment line(s) follow, each starting with a "|":',
        f"|<SCNL>{code}    <AUTH> 2019/02/01 21:38:15.000",
    ]
    return written(tmp_path, [*head, announced, *rows], "file.v2c")


COLUMN = "   64 acceleration pts, approx    1 secs, units=cm/sec2(04),Format=(1E15.6)"
DIRECTIONS = {
    "code alone": ("Sta Chan   ?:Other   (Rcrdr Chan  ?) Location:", 0, "BMR.BNZ.AK.--", None, ""),
    "words": ("Sta Cha:  1: 340 deg (Rcrdr Chan  1) Location: Roof", 0, "", 340.0, "Roof"),
    "numbers": ("Sta Chan   2:       (Rcrdr Chan  2) Location:", 75, "", 75.0, ""),
    "vertical number": ("Sta Chan   3: ?     (Rcrdr Chan  3) Location:", 400, "", None, ""),
}


@pytest.mark.parametrize(
    ("channel", "number", "code", "azimuth", "place"), DIRECTIONS.values(), ids=DIRECTIONS
)
def test_cosmos_directions(tmp_path, channel, number, code, azimuth, place):
    rows = in_columns(WAVE, "15.6e", 1)
    (found,) = read_measured(cosmos(tmp_path, channel, COLUMN, rows, number, code)).channels
    assert (found.azimuth_deg, found.location, found.vertical) == (azimuth, place, azimuth is None)
    np.testing.assert_allclose(found.values, WAVE, rtol=1e-6)


@pytest.mark.parametrize("called", ["acceleration pts", "raw accel.   pts"])
def test_cosmos_counts_become_g_by_the_headers(tmp_path, called):
    """2.4 microvolts a count, 1.25 V per g."""
    channel = "Sta Chan   1: 90 deg (Rcrdr Chan  1) Location:"
    announced = f"  64 {called}, approx   1 secs, units=counts (50),Format=(10I8)"
    counts = np.round(1e4 * WAVE).astype(int)
    rows = in_columns(counts, "8d", 10)
    header = {22: 2.4, 42: 1.25, 64: -7e4}.items()
    path = cosmos(tmp_path, channel, announced, rows, 90, real=header)
    (found,) = read_measured(path).channels
    assert (found.unit, found.stated_peak) == ("g", pytest.approx(7e4 * 2.4e-6 / 1.25))
    np.testing.assert_allclose(found.values, counts * 2.4e-6 / 1.25, rtol=1e-12)
    bare = cosmos(tmp_path, channel, announced, rows, 90)
    with pytest.raises(MeasurementError, match="do not give what a count is"):
        read_measured(bare)


def smc(tmp_path, rate):
    place = "station = San Francisco, 1295 Shafter, F component=    360"
    text = ["2 CORRECTED ACCELEROGRAM", *"****", place, *"*****"]
    whole, real = [-32768] * 48, [1.7e38] * 50
    whole[15], whole[16], real[1] = 1, 64, rate
    numbers = [*in_columns(whole, "10d"), *in_columns(real, "15.7E", 5), "|"]
    return written(tmp_path, [*text, *numbers, *in_columns(WAVE)], "a.smc")


def test_smc_of_pairs_as_they_were_digitised_is_refused(tmp_path):
    with pytest.raises(MeasurementError, match="raw pairs of times and values"):
        read_measured(smc(tmp_path, 1.7e38))


RESULT = """\
    -1
  2414
         1
MODE 1
         1
NONE
NONE
NONE
NONE
MODE NUMBER;         4 FREQUENCY; 2.10000E+00
         1         2         2         8         2         3
         0         1         0         0         1         4         0         0
         0         0
  0.00000E+00  2.10000E+00  1.00000E+00  1.00000E+00  1.50000E-02  0.00000E+00
  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00
         1
  5.00000E-01  2.00000E-02  0.00000E+00
         7
  1.00000E+00  3.00000E-02  0.00000E+00
    -1"""
HISTORY = """\
    -1
    58
1x : m/s²
UFF58 file created by HBM catman
30-Apr-20 19:12:52
NONE
NONE
    1         0    0         0 NONE               0   0 NONE               0   0
         2         {count}         1 0.00000E+000 5.00000E-005 0.00000E+000
        17    0    0    0 Time                 s
         1    0    0    0 1x                   m/s²
         0    0    0    0 NONE                 NONE
         0    0    0    0 NONE                 NONE
 -3.81956E+00 -3.56616E+00 -2.98987E+00 -2.62207E+00 -3.22879E+00 -3.63712E+00
 -3.90210E+00
    -1"""


def test_universal_files(tmp_path):
    pytest.importorskip("pyuff", reason="pyuff (extra `formats`) is not installed")
    (mode,) = read_measured(written(tmp_path, RESULT.split("\n"), "mode.uff")).modes
    assert (mode.name, mode.frequency_hz, mode.damping) == ("4", 2.1, 0.015)
    shape = dict(zip(mode.sensors, mode.shape, strict=True))
    assert (shape["point 1 +X"], shape["point 7 +Y"]) == (0.5, 0.03)
    whole = written(tmp_path, HISTORY.format(count=7).split("\n"), "history.uff")
    (channel,) = read_measured(whole).channels
    assert (channel.name, channel.quantity, channel.unit) == ("1x", "acceleration", "m/s²")
    for text, words in ((HISTORY.format(count=9), "9 values but 7"), (HISTORY[:-6], "no end")):
        with pytest.raises(MeasurementError, match=words):
            read_measured(written(tmp_path, text.split("\n"), "cut.uff"))


TITLES = ["Mode", "Frequency [Hz]", "Std. Frequency [Hz]", "Damping Ratio [%]", "Complexity [%]"]


def test_modes_as_programs_export_them(tmp_path):
    rows = ["\t".join([*TITLES, "2F", "RF"]), "EFDD Mode 1\t1.753\t0.004\t1.02\t0.5\t0.4\t1"]
    modes = identified_modes(read_measured(written(tmp_path, rows)), None, "x")
    assert (modes.names, modes.floors) == (("1",), ("2F", "RF"))
    found = [modes.frequency_hz[0], modes.frequency_sd_hz[0], modes.damping[0]]
    np.testing.assert_allclose(found, [1.753, 0.004, 0.0102])


@pytest.mark.parametrize("name", ["base/RF", "2F/base", "2F/base_re"])
def test_a_force_or_a_sensor_on_the_base_is_refused_by_name(tmp_path, name):
    rows = [f"frequency_hz,{name} (m/s2/N)", *(f"{k},1e-4" for k in range(1, 20))]
    with pytest.raises(MeasurementError, match=f"'{name}' is of a force or a sensor on the base"):
        read_observation_file(written(tmp_path, rows))


def test_the_base_in_a_shape_is_left_out_and_told(tmp_path):
    path = written(tmp_path, ["mode,frequency_hz,base,2F,RF", "1,1.7,0.1,0.4,1"])
    modes = identified_modes(read_measured(path), None, "x")
    assert modes.floors == ("2F", "RF")
    assert modes.notes == ("The shapes' component at the base is left out.",)


def test_modes_below_a_title_and_with_names_of_their_own(tmp_path):
    rows = ["Results of the tower", "f [Hz];ζ [%];A1;A2", "1,75;1,2;0,35;1", "5,1;1,0;-1;0,4"]
    path = written(tmp_path, rows, encoding="utf-8")
    one = inspect_file(path)
    assert [mode.sensors for mode in one.modes] == [("A1", "A2")] * 2
    assert one.recording.notes == ("Lines above the table that are passed over: 1.",)
    assert one.step.command.endswith("file.txt --columns 2F=NAME,RF=NAME")
    with pytest.raises(MeasurementError, match="unknown column 'A1'"):
        identified_modes(read_measured(path), None, "x")
    told = inspect_file(path, None, {"RF": "A2"})
    assert [mode.sensors for mode in told.modes] == [("RF",)] * 2
    assert told.step.command.endswith("file.txt --columns RF=A2")
    modes = identified_modes(read_measured(path), {"RF": "A2"}, "x")
    np.testing.assert_allclose(modes.damping, [0.012, 0.01])


def test_labels_and_units_in_a_structure_name_the_columns(tmp_path):
    path = tmp_path / "a.mat"
    labels, units = (np.array(own, dtype=object) for own in (["base", "RF"], ["g", "m/s^2"]))
    both = np.column_stack([WAVE, 2.0 * WAVE])
    savemat(path, {"d": {"acc": both, "fs": 100.0, "ChannelNames": labels, "Units": units}})
    table = read_measured(path).table
    assert (table.names, table.units) == (("time_s", "base", "RF"), (None, "g", "m/s^2"))
    np.testing.assert_array_equal(table.values[:, 2], 2.0 * WAVE)


def test_damping_ratios_of_arrays_under_other_names(tmp_path):
    path = tmp_path / "modes.npz"
    np.savez(path, Natural_Frequencies=[1.7, 5.0], DampingRatio=[0.01, 0.02], ModeShapes=np.eye(2))
    modes = identified_modes(read_measured(path), {"2F": "1", "RF": "2"})
    assert modes.frequency_hz.tolist() == [1.7, 5.0]
    assert modes.damping.tolist() == [0.01, 0.02]


LOGGERS = {
    "logger": (["Device: QDAC 24", "Sampling rate: 100 Hz", "", "Time (s),base (g),RF (g)"], ","),
    "catman": (["Header lines:\t4", "Date:\t1.1.2020", "Time\tbase\tRF", "s\tm/s²\tm/s²"], "\t"),
    "percent signs": (["% acceleration of a frame", "time_s,base,RF", "s,gal,gal"], ","),
    "dates": (["timestamp;base;RF", "-;mm/s2;mm/s2"], ";"),
}


@pytest.mark.parametrize(("head", "mark"), LOGGERS.values(), ids=LOGGERS)
def test_tables_of_loggers(tmp_path, head, mark):
    clock = "2020-01-31 23:59:{:06.3f}" if mark == ";" else "{:.3f}"
    many = np.tile(WAVE, 2)
    rows = [
        mark.join([clock.format(10.0 + 0.01 * k), f"{v / 1e3:.8f}", f"{v / 500:.8f}"])
        for k, v in enumerate(many)
    ]
    data = read_observation_file(written(tmp_path, [*head, *rows]))
    assert (data.time_step, data.floors) == (0.01, ("RF",))
    factor = {"logger": 9.80665, "catman": 1.0, "percent signs": 0.01, "dates": 1e-3}
    name = next(key for key, value in LOGGERS.items() if value[0] is head)
    expected = factor[name] * np.stack([many / 1e3, many / 500])
    np.testing.assert_allclose(data.acceleration, expected, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(("name", "factor"), [("Freq (kHz)", 1e-3), ("omega", 2.0 * np.pi)])
def test_frequencies_in_other_units(tmp_path, name, factor):
    lines = [f"{name},2F,RF", *(f"{factor * hz},1.5,2" for hz in range(1, 9))]
    seen = read_observation_file(written(tmp_path, lines, "a.csv"))
    np.testing.assert_allclose(seen.frequency_hz, np.arange(1.0, 9.0))
    lines = ["period_s,2F,RF", *(f"{1.0 / hz},1.5,2" for hz in range(1, 9))]
    with pytest.raises(MeasurementError, match="of periods give frequencies"):
        inspect_file(written(tmp_path, lines, "b.csv"))
    lines = ["time (seconds),base,RF", *(f"{k},{k % 3},2" for k in range(12))]
    assert inspect_file(written(tmp_path, lines, "b.csv"), "2.5 gal").channels[0].peak_m_s2 == 0.05
    for lines[0] in ("Freq (kHzz),2F,RF", "time (msx),2F,RF"):
        with pytest.raises(MeasurementError, match=r"column \w+ \(\w+\): unknown unit '\w+' for"):
            inspect_file(written(tmp_path, lines, "b.csv"))
    for unit in ("x gal", "-1 gal", "1.2.3 gal"):
        with pytest.raises(MeasurementError, match=f"unknown unit '{unit}'"):
            inspect_file(written(tmp_path, ["time_s,base,RF", *lines[1:]], "b.csv"), unit)


@pytest.mark.parametrize("head", ["frequency_hz,a", "frequency_hz,2F/RF (m/s2/N)"])
def test_frequencies_out_of_order_are_refused_when_a_file_is_inspected(tmp_path, head):
    with pytest.raises(MeasurementError, match=r"line 4, .*; sort the rows by frequency"):
        inspect_file(written(tmp_path, [head, "1,1", "3,1", "2,1", "4,1"]))


@pytest.mark.parametrize(
    "of_floor",
    [
        ("{} (dB)", "phase {} (°)"),
        ("{} Magnitude [dB re 1]", "{} Angle [deg]"),
        ("|{}|", "{}_phase (rad)"),
        ("{}_mag", "{}_phase (deg)"),
        ("{}_db",),
    ],
)
def test_levels_and_phases_of_response_functions(tmp_path, of_floor):
    h = {"2F": np.array([1.0, 1.2 - 0.5j, -2.0j, -0.3]), "RF": np.array([1.0, 2j, -5.0 - 1j, 0.1])}
    head, rows = ["Freq (Hz)"], [np.arange(1.0, 5.0)]
    for floor, values in h.items():
        size, angle = np.abs(values), np.angle(values, deg="rad" not in of_floor[-1])
        head += [title.format(floor) for title in of_floor]
        rows += [20 * np.log10(size) if "db" in of_floor[0].lower() else size, angle][
            : len(of_floor)
        ]
    path = tmp_path / "frf.csv"
    np.savetxt(path, np.array(rows).T, delimiter=";", header=";".join(head), comments="")
    seen = read_observation_file(path)
    np.testing.assert_allclose(np.exp(seen.log_frf), np.abs([*h.values()]), rtol=1e-12)
    if len(of_floor) == 2:
        turned = np.exp(1j * (seen.phase - np.angle([*h.values()])))
        np.testing.assert_allclose(turned, 1.0, atol=1e-12)
        text = path.read_text("utf-8")
        path.write_text(re.sub(r" [(\[](°|deg|rad)[)\]]", "", text), "utf-8")
        with pytest.raises(MeasurementError, match=r"write \(deg\) or \(rad\) behind"):
            read_measured(path)
