"""Files that are none, for every reader: nothing hangs, nothing fills the memory."""

import os
from pathlib import Path

import pytest

from femupdate.building import load_building
from femupdate.errors import BuildingError, FemupdateError, MeasurementError, StudyError
from femupdate.measurement import read_observation_file, read_record
from femupdate.storage import read_file


def test_a_file_that_is_too_large(tmp_path):
    (tmp_path / "f").write_bytes(bytes(2_000_001))
    with pytest.raises(StudyError, match=r"f has 2 MB, more than the 1 MB .*split it"):
        read_file(tmp_path / "f", 1_000_000, StudyError)


def fifo(folder):
    os.mkfifo(folder / "pipe.csv")
    return folder / "pipe.csv"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes and devices of POSIX")
@pytest.mark.parametrize("make", [fifo, lambda folder: Path("/dev/zero")], ids=["pipe", "device"])
@pytest.mark.parametrize("read", [load_building, read_observation_file, read_record])
def test_pipes_and_devices(tmp_path, make, read):
    with pytest.raises(FemupdateError, match="is a pipe or a device; save its content as a file"):
        read(make(tmp_path))


def test_limits_of_texts(tmp_path):
    with open(tmp_path / "long.csv", "wb") as file:
        file.write(b"time_s,a\ns,gal\n0,1\n")
        file.truncate(300_000_001)  # the rest takes no room on the disk
    with pytest.raises(MeasurementError, match="more than the 300 MB that such a file may have"):
        read_record(tmp_path / "long.csv")
    (tmp_path / "b.toml").write_bytes(b" " * 20_000_001)
    with pytest.raises(BuildingError, match="too large for a building file"):
        load_building(tmp_path / "b.toml")
