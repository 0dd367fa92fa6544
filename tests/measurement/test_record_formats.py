"""Every record format, written from known values and read back."""

from pathlib import Path

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import GroundMotion, read_measured, read_record
from femupdate.measurement.reader import readers
from femupdate.units import STANDARD_GRAVITY
from tests.measurement import written

# The files hold printed digits, and reading them takes one multiplication: a few ulp.
EXACT = {"rtol": 1e-14, "atol": 0}


def test_jma_gives_the_named_channel_in_si(write, wave):
    channels = {"NS": wave, "EW": -2 * wave, "UD": wave + 1}
    path = write(written.jma_text(channels))
    motion = read_record(path, channel="EW")
    np.testing.assert_allclose(motion.acceleration, -2 * wave * 1e-2, **EXACT)
    assert motion.time_step == 1 / 50
    recording = read_measured(path)
    assert (recording.format, motion.channel) == ("jma", "EW")
    assert [one.name for one in recording.channels] == ["NS", "EW", "UD"]
    assert motion.name == "record"


@pytest.mark.parametrize("count", [10, 11, 14, 15])
def test_peer_whether_or_not_the_last_row_is_full(write, wave, count):
    values = wave[:count] / 981
    path = write(written.peer_text(values), "RSN1.AT2")
    motion = read_record(path)
    printed = np.array([float(f"{value:.7E}") for value in values])
    np.testing.assert_allclose(motion.acceleration, printed * STANDARD_GRAVITY, **EXACT)
    assert motion.time_step == 0.01
    assert (read_measured(path).format, motion.channel) == ("peer", "337")


def test_csmip_volume_1_reads_columns_by_width(write, wave):
    values = np.round(wave / 981, 6)
    wide = -1.234567 - np.arange(19) * 0.01  # nine characters: neighbours touch
    path = write(
        written.csmip_v1_text({" 90 Deg": values, "360 Deg": wide, " 180 Deg": -values[:16]}),
        "a.v1",
    )
    assert "-1.234567-1.244567" in path.read_text()
    first, second, third = (read_record(path, channel=i) for i in (1, "360", "180"))
    np.testing.assert_allclose(first.acceleration, values * STANDARD_GRAVITY, **EXACT)
    np.testing.assert_allclose(second.acceleration, wide * STANDARD_GRAVITY, **EXACT)
    np.testing.assert_allclose(third.acceleration, -values[:16] * STANDARD_GRAVITY, **EXACT)
    assert [one.name for one in read_measured(path).channels] == ["90 Deg", "360 Deg", "180 Deg"]
    assert (read_measured(path).format, first.time_step) == ("csmip", 0.01)


def test_csmip_volume_2_takes_the_acceleration_block_alone(write, wave):
    motion = read_record(write(written.csmip_v2_text(wave), "CE1.V2"))
    np.testing.assert_allclose(motion.acceleration, wave * 1e-2, **EXACT)
    assert motion.time_step == 0.005
    assert motion.channel == "270 Deg, Roof - center"


def test_knet_scales_counts_and_keeps_the_offset(write):
    counts = [-11657, -11655, 4210, -30012, 8, 0, 1, 2, -3, 2500]
    path = write(written.knet_text(counts, "0.1"), "TST.EW")
    motion = read_record(path)
    expected = np.array(counts) * 7845 / 8223790 * 1e-2
    np.testing.assert_allclose(motion.acceleration, expected, **EXACT)
    assert (read_measured(path).format, motion.channel) == ("knet", "E-W")
    assert motion.time_step == 0.01


def table(values, delimiter=",", head="", step=0.02, decimals=2):
    rows = [
        f"{i * step:.{decimals}f}{delimiter}{value:.3f}" for i, value in enumerate(values.tolist())
    ]
    return head + "\n".join(rows) + "\n"


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "   ", ", "])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_plain_table_with_any_delimiter_and_line_end(write, wave, delimiter, ends):
    text = table(wave, delimiter, "# from a friend\n\n").replace("\n", ends)
    path = write(text, "a.txt")
    motion = read_record(path, unit="gal")
    np.testing.assert_allclose(motion.acceleration, wave * 1e-2, **EXACT)
    assert (read_measured(path).format, motion.time_step) == ("plain", 0.02)


@pytest.mark.parametrize(
    "head",
    ["time_s,acc\ns,gal\n", "time (s),acc (gal)\n", '"Time","acc [cm/s^2]"\n', "t,acc\nms,cm/s2\n"],
)
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_plain_table_states_its_unit_in_the_header(write, wave, head, mark):
    step = 20.0 if "ms" in head else 0.02
    motion = read_record(write(mark + table(wave, head=head, step=step)))
    np.testing.assert_allclose(motion.acceleration, wave * 1e-2, **EXACT)
    assert motion.time_step == pytest.approx(0.02, rel=1e-14)  # a product of two rounded numbers
    assert motion.channel == "acc"


def test_plain_table_with_decimal_commas(write, wave):
    text = table(wave, ";", "time;a\ns;mm/s2\n").replace(".", ",")
    motion = read_record(write(text))
    np.testing.assert_allclose(motion.acceleration, wave * 1e-3, **EXACT)


def test_two_sensors_of_one_direction_are_told_apart_by_number(write, wave):
    path = write(written.csmip_v1_text({"90 Deg": wave / 981, "90 Deg ": wave / 500}), "a.v1")
    peak = read_record(path, channel="2").peak
    assert peak == pytest.approx(np.abs(np.round(wave / 500, 6)).max() * STANDARD_GRAVITY)


def test_format_can_be_forced(write, wave):
    path = write("# NPTS= 3, DT= .01\n" + table(wave))
    assert read_measured(path).format == "plain"
    assert list(readers())[-1] == "plain"  # it fits nearly every file


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("gal", 1e-2), ("cm/s^2", 1e-2), ("m/s/s", 1.0), ("g", 9.80665), ("mg", 9.80665e-3),
     ("in/s2", 0.0254), ("cm/sec2", 1e-2), ("cm/sec/sec", 1e-2)]
)  # fmt: skip
def test_unit_option(write, wave, unit, factor):
    small = wave / 100
    path = write(table(small))
    printed = np.round(small, 3)
    np.testing.assert_allclose(
        read_record(path, unit=unit).acceleration, printed * factor, rtol=1e-14, atol=0
    )


@pytest.mark.parametrize(
    ("rate", "decimals"), [(120, 6), (120, 3), (200, 3), (128, 7), (100, 2), (60, 4), (1000, 4)]
)
def test_rounded_times_give_the_exact_rate(write, wave, rate, decimals):
    path = write(table(wave, step=1 / rate, decimals=decimals))
    assert read_record(path, unit="gal").time_step == 1 / rate


MIDDLE = 6.0


def tone(frequency: float, time: np.ndarray) -> np.ndarray:
    """A tone that starts and ends gently, so that its spectrum is narrow."""
    envelope = np.exp(-(((time - MIDDLE) / 1.5) ** 2))
    return np.sin(2 * np.pi * frequency * time + 0.3) * envelope


@pytest.mark.parametrize(
    ("old", "new"), [(0.01, 0.005), (0.01, 0.02), (1 / 120, 0.005), (0.02, 0.001), (0.005, 1 / 128)]
)
@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_resampling_keeps_a_tone_in_place_and_size(old, new, share):
    frequency = share * 0.5 / max(old, new)
    time = np.arange(round(2 * MIDDLE / old)) * old
    resampled = GroundMotion(tone(frequency, time), old).resampled(new)
    assert resampled.time_step == new
    assert resampled.duration == pytest.approx(time[-1], abs=max(old, new))
    # The docstring's passband: flat within 0.1 % up to 0.9 of the lower Nyquist frequency.
    exact = tone(frequency, resampled.time)
    np.testing.assert_allclose(resampled.acceleration, exact, atol=1e-3)


def test_resampling_removes_what_the_new_step_cannot_show():
    time = np.arange(2400) * 0.005
    high = GroundMotion(tone(40.0, time), 0.005)
    # 40 Hz lies above the new Nyquist frequency of 25 Hz and must not fold down to 10 Hz.
    assert high.resampled(0.02).peak < 1e-3


@pytest.mark.parametrize("step", [0.0, -0.01, np.nan, np.inf, 0.01 / np.sqrt(2), 1e-9])
def test_resampling_to_an_impossible_step(step):
    with pytest.raises(MeasurementError, match="cannot be resampled"):
        GroundMotion(np.ones(20_000), 0.01).resampled(step)


def test_scaled():
    motion = GroundMotion(np.r_[np.full(50, 2.0), np.arange(50.0)], 0.01)
    np.testing.assert_array_equal(motion.scaled(-0.1).acceleration, -0.1 * motion.acceleration)
    assert motion.peak == 49.0
    named = GroundMotion(motion.acceleration, 0.01, name="kobe", channel="NS")
    assert named.title == "kobe NS"
    assert named.scaled(0.5).scaled(0.2).title == "kobe NS, scaled by 0.1"
    for factor in (0.0, np.nan):
        with pytest.raises(MeasurementError, match=f"cannot be scaled by {factor:g}"):
            motion.scaled(factor)


@pytest.mark.parametrize(
    "values", [[1.0], [1.0, np.nan], [1.0, np.inf], np.ones((2, 3)), []], ids=repr
)
def test_what_is_no_motion(values):
    with pytest.raises(MeasurementError, match="one row of at least two"):
        GroundMotion(np.array(values), 0.01)


RECORD = "records/ridgecrest_2019_clc.v1"
EXAMPLE = Path(__file__).resolve().parents[2] / "examples/records/ridgecrest_2019_clc_90.csv"


# What the file's own headers state (three decimals of g).
@pytest.mark.parametrize(
    ("channel", "count", "peak_g", "at_s"),
    [(1, 31932, 0.344, 234.36), ("360 Deg", 32080, 0.511, 235.70)],
)
def test_header_peak_comes_out(shared_file, channel, count, peak_g, at_s):
    motion = read_record(shared_file(RECORD), channel=channel)
    assert motion.acceleration.size == count
    assert motion.time_step == 0.01
    at = int(np.argmax(np.abs(motion.acceleration)))
    assert motion.peak / STANDARD_GRAVITY == pytest.approx(peak_g, abs=5e-4)
    assert motion.time[at] == pytest.approx(at_s, abs=1e-9)


def test_the_vertical_channel_is_refused(shared_file):
    with pytest.raises(MeasurementError, match="'Up' is vertical, as the file says"):
        read_record(shared_file(RECORD), channel="up")


def test_shipped_part_is_the_original_less_its_quiet_mean(shared_file):
    whole = read_record(shared_file(RECORD), channel="90 Deg")
    part = read_record(EXAMPLE)
    inside = whole.acceleration[20_000:29_001]
    expected = inside - inside[:2401].mean()
    assert (part.time_step, part.channel) == (0.01, "90 Deg")
    # Written with nine significant digits.
    np.testing.assert_allclose(part.acceleration, expected, rtol=5e-9)
