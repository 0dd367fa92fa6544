"""The number of processors, on systems that tell it and on others."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from femupdate.processors import everywhere, processor_count


def test_processors_that_this_process_may_use():
    assert 1 <= processor_count() <= (os.cpu_count() or 1)


def test_systems_without_affinity(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processor_count() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processor_count() == 1


@pytest.mark.parametrize("dof", [10, 10_000])  # in this process, and in processes of their own
def test_work_comes_back_in_order(dof):
    assert list(everywhere(abs, [-3, 1, -4, 1, -5, 9, -2], dof)) == [3, 1, 4, 1, 5, 9, 2]
    assert list(everywhere(abs, [], dof)) == []


WORK = """\
import os, time
from femupdate.processors import everywhere


def task(folder):
    open(f"{folder}/{os.getpid()}", "w").close()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        pass


if __name__ == "__main__":
    list(everywhere(task, [os.environ["FOLDER"]] * 4, 10_000))
"""


def alive(process):
    """Whether it runs; one that has ended and that nobody has asked about yet does not."""
    try:
        stat = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(sys.platform != "linux", reason="looks at processes in /proc")
def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    """In the middle of a task that would take a minute."""
    script, folder = tmp_path / "work.py", tmp_path / "workers"
    folder.mkdir()
    script.write_text(WORK)
    command = [sys.executable, str(script)]
    environment = {**os.environ, "FOLDER": str(folder)}
    with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as parent:
        while not list(folder.iterdir()):
            time.sleep(0.05)
        workers = [int(path.name) for path in folder.iterdir()]
        assert parent.pid not in workers or processor_count() == 1
        assert all(map(alive, workers))
        parent.kill()
    end = time.monotonic() + 10.0
    while any(map(alive, workers)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(map(alive, workers))
