"""Files written are read back as they were, whole or not at all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.measurement import (
    Histories,
    channel_name,
    floor_height,
    parse_channel,
    read_observation_file,
    write_observation_histories,
)


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
