"""Every record format, written from known values and read back."""

import numpy as np
import pytest

from femupdate.measurement import read_measured, read_record
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
