"""One process at a time writes into a study."""

import signal
import subprocess
import sys

import pytest

from femupdate.errors import StudyError
from femupdate.study import locked

HOLD = """\
import sys, time
from pathlib import Path
from femupdate.study import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the study; it never frees it of its own accord."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / "study")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_another_process_waits(holder, tmp_path):
    wanted = "^another process is writing into the study"
    with pytest.raises(StudyError, match=wanted), locked(tmp_path / "study"):
        pass


@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM"])
def test_a_lock_dies_with_its_owner(holder, tmp_path, name):
    holder.send_signal(getattr(signal, name))
    holder.wait()
    assert (tmp_path / "study" / ".lock").exists()  # what is left of it holds nobody up
    with locked(tmp_path / "study"):
        pass
    assert not (tmp_path / "study").exists() or not list((tmp_path / "study").iterdir())


def test_parts_of_killed_processes_are_removed(tmp_path):
    parts = [
        ".posterior-0a1b2c3d.part.nc",
        "pictures/.modes-12345678.part.png",
    ]
    others = [".posterior.part.nc", "posterior-0a1b2c3d.part.nc", "notes/.x-12345678.part.txt"]
    for name in (*parts, *others):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("half")
    with locked(tmp_path):
        pass
    assert not any((tmp_path / name).exists() for name in parts)
    assert all((tmp_path / name).exists() for name in others)


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(StudyError, match=r"cannot write .*check the folder"),
        locked(tmp_path / "file" / "study"),
    ):
        pass
