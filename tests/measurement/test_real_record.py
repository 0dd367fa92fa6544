"""The real Ridgecrest record, and the part of it that is shipped."""

from pathlib import Path

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import read_record
from femupdate.units import STANDARD_GRAVITY

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
