"""The benchmark of frames: its motions, its sensors and how it counts."""

from dataclasses import replace

import numpy as np
import pytest
from femupdate.benchmarks.frame_coverage import BUILDING
from femupdate.benchmarks.frame_coverage.motions import RECORDED, SIMULATED, WHITE, base_motion
from femupdate.benchmarks.frame_coverage.run import Case, counted, meshed, written

from femupdate.building import load_building
from femupdate.measurement import read_observation_file

CASE = Case(
    truth="mesh of 0.4",
    motion=WHITE,
    theta=np.array([1.0, 2.0]),
    zeta=0.02,
    mean=np.array([1.1, 1.9]),
    sd=np.array([0.1, 0.02]),
    low=np.array([0.95, 1.87]),
    high=np.array([1.25, 1.93]),
    zeta_low=0.015,
    zeta_high=0.018,
    misfit=1.0,
    seconds=1.0,
)


def test_what_is_held_iscounted():
    found = counted([CASE, replace(CASE, zeta=0.016)])
    assert found["within_90"] == found["zeta_within_90"] == 0.5
    assert found["rms_z"] == pytest.approx(np.sqrt((1.0 + 25.0) / 2.0))
    assert found["median_sd"] == pytest.approx((0.1 + 0.01) / 2.0)


@pytest.mark.parametrize("kind", [WHITE, RECORDED, SIMULATED])
def test_every_motion_has_a_strength_of_its_own(kind):
    first, again, other = (base_motion(kind, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.acceleration, again.acceleration)
    assert first.peak != pytest.approx(other.peak, rel=1e-3)
    assert 0.3 < first.peak < 6.0
    assert abs(first.acceleration.mean()) < 0.02 * first.peak


def test_floors_follow_a_slow_base(tmp_path):
    """At low frequency every floor moves as its base does, but for the sensors' noise."""
    building = load_building(BUILDING)
    coarse = building.model_copy(update={"mesh": building.mesh.model_copy(update={"size": 2.0})})
    truth = meshed(1.0, coarse, np.ones(3))
    rng = np.random.default_rng(3)
    base = base_motion(WHITE, rng)
    slow = replace(base, acceleration=np.sin(np.pi * base.time))
    read = read_observation_file(written(tmp_path, truth, 0.05, slow, rng))
    assert [channel.floor for channel in read.channels] == ["base", "2F", "3F", "RF"]
    late = read.acceleration[:, 2000:]
    np.testing.assert_allclose(late[1:], late[[0, 0, 0]], atol=0.08)
    assert (late[1:].std(axis=1) > late[0].std()).all()
