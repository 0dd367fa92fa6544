"""What can be done with a ground motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femupdate.errors import MeasurementError
from femupdate.measurement.record import GroundMotion

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


def test_resampling_to_the_same_step_changes_nothing():
    motion = GroundMotion(np.arange(20.0), 0.01)
    assert motion.resampled(0.01) is motion


@pytest.mark.parametrize("step", [0.0, -0.01, np.nan, np.inf, 0.01 / np.sqrt(2), 1e-9])
def test_resampling_to_an_impossible_step(step):
    with pytest.raises(MeasurementError, match="cannot be resampled"):
        GroundMotion(np.ones(20_000), 0.01).resampled(step)


def test_cut_includes_both_ends_and_begins_at_zero():
    motion = GroundMotion(np.arange(100.0), 0.01, channel="NS")
    part = motion.cut(0.1, 0.3)
    np.testing.assert_array_equal(part.acceleration, np.arange(10.0, 31.0))
    assert part.time[0] == 0.0
    assert part.channel == "NS"
    assert part.duration == pytest.approx(0.2)
    part.acceleration[:] = 0  # a copy: the whole record is untouched
    assert motion.acceleration[20] == 20.0


@given(st.integers(0, 98), st.integers(1, 99), st.sampled_from([0.01, 1 / 120, 0.3]))
def test_cut_at_sample_times_is_a_slice(first, length, step):
    motion = GroundMotion(np.arange(200.0), step)
    part = motion.cut(first * step, (first + length) * step)
    np.testing.assert_array_equal(part.acceleration, np.arange(first, first + length + 1.0))


@pytest.mark.parametrize("ends", [(0.3, 0.1), (-0.1, 0.2), (0.5, 1.5), (0.2, 0.2), (0.201, 0.204)])
def test_cut_outside_the_record(ends):
    with pytest.raises(MeasurementError, match=r"does not lie within a record of 0\.99 s"):
        GroundMotion(np.arange(100.0), 0.01).cut(*ends)


def test_scaled_and_demeaned():
    motion = GroundMotion(np.r_[np.full(50, 2.0), np.arange(50.0)], 0.01)
    np.testing.assert_array_equal(motion.scaled(-0.1).acceleration, -0.1 * motion.acceleration)
    np.testing.assert_array_equal(motion.demeaned(0, 0.49).acceleration, motion.acceleration - 2.0)
    assert motion.demeaned().acceleration.mean() == pytest.approx(0, abs=1e-14)
    assert motion.peak == 49.0
    with pytest.raises(MeasurementError, match="cannot be scaled by nan"):
        motion.scaled(np.nan)


@pytest.mark.parametrize(
    "values", [[1.0], [1.0, np.nan], [1.0, np.inf], np.ones((2, 3)), []], ids=repr
)
def test_what_is_no_motion(values):
    with pytest.raises(MeasurementError, match="one row of at least two"):
        GroundMotion(np.array(values), 0.01)


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan])
def test_step_must_be_positive(step):
    with pytest.raises(MeasurementError, match="give seconds above zero"):
        GroundMotion(np.ones(5), step)
