"""The base's rotation from vertical sensors: its sign, what is refused, and what is said of it."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import (
    estimate_frf,
    inspect_file,
    parse_channel,
    pooled,
    read_observation_file,
    rotation_of,
)

STEP, COUNT = 0.02, 3000
GRID = np.arange(2, 60) * 0.2


def channels(*names):
    return tuple(parse_channel(name) for name in names)


def test_a_base_that_goes_down_in_front_turns_forward():
    """Places are neither even nor about zero, and the base jumps as a whole besides."""
    rng = np.random.default_rng(2)
    rotation, lift = rng.standard_normal((2, 50))
    places = (-1.0, 2.5, 7.0)
    rows = np.stack([rng.standard_normal(50), *(lift - place * rotation for place in places)])
    names = ("base", *(f"base@{place}.z" for place in places))
    found = rotation_of(channels(*names), rows)
    np.testing.assert_allclose(found, rotation - rotation.mean(), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "place"), [("base@2.z", 2.0), ("BASE@-0.25.Z", -0.25), ("base@+3.50.z", 3.5)]
)
def test_places_are_read_from_names(name, place):
    found = parse_channel(name)
    assert (found.floor, found.direction, found.place) == ("base", "z", place)
    assert parse_channel(found.name) == found


@pytest.mark.parametrize("name", ["base@2.x", "2F@2.z", "base@z", "base@2", "base@1e3.z"])
def test_other_names_are_no_vertical_sensors_of_the_base(name):
    assert parse_channel(name) is None


def written(path, names, change=lambda rows: None, unit="m/s2"):
    """A rigid roof 10 m up, on a base that turns by .03 a metre and a little of its own."""
    rng = np.random.default_rng(3)
    base = rng.standard_normal(COUNT)
    rotation = 0.03 * base + 0.01 * rng.standard_normal(COUNT)
    motion = {"base": base, "RF": base + 10.0 * rotation}
    rows = [
        motion.get(name, -(parse_channel(name).place or 1.0 + k) * rotation)
        for k, name in enumerate(names)
    ]
    table = np.column_stack([STEP * np.arange(COUNT), *rows])
    change(table)
    head = ",".join(["time_s", *names]) + "\n" + ",".join(["s", *[unit] * len(names)])
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.9g")
    return path


def test_a_file_of_both_motions(tmp_path):
    path = written(tmp_path / "both.csv", ("base", "RF", "base@-2.z", "base@3.z"))
    observation = estimate_frf(read_observation_file(path), GRID)
    # What is not its own goes with the translation, all over the band.
    assert np.nanmean(observation.beside[0].real) == pytest.approx(0.03, abs=0.002)
    assert any(
        "by vertical sensors at -2, 3 m and is an input" in note for note in observation.notes
    )
    # All of the roof's motion is explained, by both together.
    assert observation.coherence.min() > 0.999


def test_runs_together_keep_the_rotation_of_each(tmp_path):
    names = ("base", "RF", "base@-2.z", "base@3.z")
    one = estimate_frf(read_observation_file(written(tmp_path / "1.csv", names)), GRID)
    other = estimate_frf(read_observation_file(written(tmp_path / "2.csv", names[:2])), GRID)
    both = pooled([one, other], ("RF",))
    share = one.noise_sd[0] ** -2 / (one.noise_sd[0] ** -2 + other.noise_sd[0] ** -2)
    np.testing.assert_allclose(both.beside, share * one.beside, rtol=1e-6)
    assert both.estimator.turns
    np.testing.assert_allclose(
        both.estimator.columns[1].sum(axis=1),
        share * one.estimator.columns[1].sum(axis=1),
        rtol=1e-6,
    )


def spike(table):
    table[700, -1] = 900.0


def nothing(table):
    table[:, -1] = 0.25


@pytest.mark.parametrize(
    ("names", "change", "unit", "message"),
    [
        (("base@2.z", "base@2.004.z"), None, "m/s2", "stand at one place"),
        (("base@-2.z", "base@2.z"), spike, "m/s2", "is the unit wrong"),
        (("base@-2.z", "base@2.z"), nothing, "m/s2", "the channel was dead; leave it out"),
        (("base@-2.z", "base@2.z"), None, "mm", "unknown unit 'mm'"),
        (("base@-2.z", "base@2.0.z", "base@2.z"), None, "m/s2", "is there twice"),
    ],
)
def test_what_cannot_be_a_rotation_is_refused(tmp_path, names, change, unit, message):
    path = written(tmp_path / "bad.csv", ("base", "RF", *names), change or (lambda _: None), unit)
    with pytest.raises(MeasurementError, match=message):
        read_observation_file(path)


@pytest.mark.parametrize("names", [("base@2.z",), ("base.z",), ("base:1.z", "base:2.z")])
def test_vertical_columns_that_tell_no_rotation_are_said_to(tmp_path, names):
    path = written(tmp_path / "few.csv", ("base", "RF", *names))
    observation = estimate_frf(read_observation_file(path), GRID)
    assert observation.beside is None
    assert not observation.estimator.turns
    assert any("not tell the base's rotation" in note for note in observation.notes)


def test_inspect_says_what_vertical_channels_tell(tmp_path):
    path = written(tmp_path / "both.csv", ("base", "RF", "base@-2.z", "base@3.z"))
    found = inspect_file(path)
    assert "measured by vertical sensors at -2, 3 m" in found.rotation[0]
    assert found.findings == ()
    # The same file without places, which a mapping gives.
    named = written(tmp_path / "plain.csv", ("base", "RF", "base:1.z", "base:2.z"))
    plain = inspect_file(named)
    assert plain.rotation == (
        "Channels 3, 4 are vertical at the base: with their places along the motion, in m,"
        " they measure how it turns. Map them under names such as base@-2.5.z.",
    )
    assert plain.findings == (
        "channels 3, 4 are vertical: no response to the base's horizontal motion.",
    )
    columns = {"base": "base", "RF": "RF", "base@-2.z": "base:1.z", "base@3.z": "base:2.z"}
    mapped = inspect_file(named, columns=columns)
    assert "measured by vertical sensors at -2, 3 m" in mapped.rotation[0]
    assert mapped.findings == ()
    assert "base@-2.z=base:1.z" in mapped.step.command
