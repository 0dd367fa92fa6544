"""Files written are read back as they were, whole or not at all."""

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
    write_observation_histories,
)
from femupdate.measurement.write import write_frfs, write_modes_uff


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
