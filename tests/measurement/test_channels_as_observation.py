"""Records of several channels as an observation: the user says which floor each one is."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import read_observation_file
from femupdate.units import STANDARD_GRAVITY
from tests.measurement import written

WAVES = np.round(np.random.default_rng(5).normal(size=(3, 80)) * 0.05, 6)


@pytest.fixture
def station(write):
    names = ("90 Deg, ground", "90 Deg, roof", "Up")
    return write(written.csmip_v1_text(dict(zip(names, WAVES, strict=True))), "station.v1")


def test_channels_by_number_and_name(station):
    data = read_observation_file(station, columns={"RF:1": "2", "base": "90 Deg, ground"})
    assert [c.name for c in data.channels] == ["RF:1", "base"]
    assert (data.time_step, data.source) == (0.01, "station.v1")
    np.testing.assert_allclose(data.acceleration, WAVES[[1, 0]] * STANDARD_GRAVITY, rtol=1e-14)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (None, r"does not say which floors .* base=1,RF=2; .*3 = Up \(peak"),
        ({"base": "1", "RF": "7"}, "there is no channel '7' to take for RF; choose by number: 1 ="),
        ({"base": "90 Deg", "RF": "2"}, "2 channels are called '90 Deg'; choose by number"),
        ({"base": "1", "roof": "2"}, "unknown column 'roof'"),
        ({"base": "1", "RF": "1"}, "'1' is mapped twice"),
        ({"base": "1", "RF": "2", "rf": "3"}, "'rf' is there twice"),
        ({"2F": "1", "RF": "2"}, "there is no column base"),
        ({"base": "1"}, "there is no floor beside the base"),
    ],
)
def test_bad_mapping(station, columns, message):
    with pytest.raises(MeasurementError, match=message):
        read_observation_file(station, columns=columns)


def test_channels_of_other_length_and_short_ones(write):
    channels = {"S": WAVES[0], "N": WAVES[1, :70], "E": WAVES[2, :63], "W": -WAVES[2, :63]}
    path = write(written.csmip_v1_text(channels), "a.v1")
    with pytest.raises(MeasurementError, match=r"'N' has 70 values every 0.01 s, 'S' 80 every"):
        read_observation_file(path, columns={"base": "S", "RF": "N"})
    with pytest.raises(MeasurementError, match="63 rows are too short for a spectrum"):
        read_observation_file(path, columns={"base": "E", "RF": "W"})
