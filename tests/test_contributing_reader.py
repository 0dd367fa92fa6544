"""The reader of CONTRIBUTING.md, put into the folder of readers, reads a file."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import read_measured, read_observation_file, read_record
from femupdate.measurement import readers as folder
from femupdate.measurement.reader import readers
from tests.helpers import contribute

VALUES = np.round(np.random.default_rng(7).normal(size=(80, 2)) * [40, 90], 2)


@pytest.fixture
def contributed(tmp_path, monkeypatch):
    """The page's reader as a module beside the others."""
    contribute("A new reader", folder, "logger", tmp_path, monkeypatch)
    readers.cache_clear()
    yield
    readers.cache_clear()


@pytest.fixture
def logged(tmp_path):
    rows = "\n".join(" ".join(f"{v:.2f}" for v in row) for row in VALUES)
    path = tmp_path / "quake.log"
    path.write_text(f"LOGGER-7; rate 200 Hz; unit mg\nbasement N; roof N\n{rows}\n")
    return path


def test_its_file_is_a_ground_motion(contributed, logged):
    motion = read_record(logged, channel="basement N")
    assert read_measured(logged).format == "logger"
    assert motion.time_step == 0.005
    np.testing.assert_allclose(motion.acceleration, VALUES[:, 0] * 9.80665e-3, rtol=1e-14)


def test_its_file_is_an_observation(contributed, logged):
    data = read_observation_file(logged, columns={"base": "1", "RF": "roof N"})
    assert data.floors == ("RF",)
    np.testing.assert_allclose(data.acceleration, VALUES.T * 9.80665e-3, rtol=1e-14)
    with pytest.raises(MeasurementError, match=r"columns option.*1 = basement N \(peak"):
        read_observation_file(logged)


def test_without_it_the_file_is_in_no_known_format(logged):
    with pytest.raises(MeasurementError):
        read_record(logged)
