"""What can be done with a ground motion."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import GroundMotion

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
