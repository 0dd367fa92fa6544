"""Work shared out by Dask: the same results as here, also when a worker is killed on the way."""

import contextlib
import math
import os
import socket
import threading
import time

import pytest
import torch

from femupdate.building import load_building
from femupdate.dynamics import System
from femupdate.errors import WorkersError
from femupdate.inference import theta_prior
from femupdate.surrogate import compute_dataset
from femupdate.workers import completed, dask_executor, everywhere, working_on
from femupdate.workflow import reduce_building

PLAN = {"samples": 90, "modes": 3, "top_hz": 12.8, "seed": 3, "shard": 6}


@pytest.fixture(scope="module")
def processes():
    """Worker processes of a scheduler, as --dask local makes them beside another one."""
    pytest.importorskip("distributed", reason="the extra `distributed` is not installed")
    with socket.socket() as other:
        with contextlib.suppress(OSError):  # there is one
            other.bind(("", 8787))
            other.listen()
        with dask_executor("local") as workers:
            yield workers


@pytest.fixture(scope="module")
def tower():
    return load_building("shear_3dof")


def spoiled():
    """Work that cannot be sent once it was done."""

    class Spoiled:
        def __init__(self):
            self.kept = None

        def __call__(self, seconds):
            self.kept = threading.Lock()
            time.sleep(seconds)
            return os.getpid()

    return Spoiled()


@pytest.mark.slow
def test_a_worker_that_comes_later_gets_work_that_was_used(processes, killer):
    """The process that replaces one that was killed asks the other for it."""
    seen = set()
    with working_on(processes):
        # Until the new process has done a piece; a hundred seconds of work at most.
        for _, process in completed(spoiled(), [0.1] * 1000):
            seen.add(process)
            if len(seen) == 2:
                killer.advance()
            if len(seen) == 3:
                break
    assert len(seen) == 3


def test_a_data_set_is_the_same_when_a_worker_is_killed(processes, tower, tmp_path, killer):
    system, prior = System(reduce_building(tower).model), theta_prior(tower)
    serial = compute_dataset(system, prior, tmp_path / "here", **PLAN)
    with working_on(processes):
        shared = compute_dataset(system, prior, tmp_path / "there", **PLAN, progress=killer)
    assert killer.killed
    assert torch.equal(shared.theta, serial.theta)
    for name in ("omega", "effect", "residual"):
        assert torch.equal(getattr(shared.modal, name), getattr(serial.modal, name))
    pieces = sorted(path.name for path in (tmp_path / "there").iterdir())
    assert pieces == [f"{k:04d}.npz" for k in range(15)]


def test_what_fails_there_is_said_here(processes):
    with working_on(processes), pytest.raises(ValueError, match="math domain error"):
        list(everywhere(math.sqrt, [4.0, -1.0]))


def preload(folder, *lines):
    """A file that worker processes run while they start."""
    (folder / "there.py").write_text("\n".join(lines))
    return [str(folder / "there.py")]


WITHOUT = {
    "none": ["import sys", "sys.modules['femupdate'] = None"],
    "0.0.9": ["from femupdate import workers", "workers.__version__ = '0.0.9'"],
}


def cluster_of(count, preload=()):
    """A scheduler and worker processes that are not femupdate's own."""
    distributed = pytest.importorskip("distributed", reason="the extra is not installed")
    return distributed.LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        memory_limit=0,
        dashboard_address=None,
        scheduler_kwargs={"dashboard_address": ":0"},
        preload=preload,
    )


@pytest.mark.parametrize("there", WITHOUT)
def test_workers_that_cannot_do_the_work_are_refused(tmp_path, there):
    """One that has not the femupdate of here would end with the work, which then waits."""
    with (
        cluster_of(1, preload(tmp_path, *WITHOUT[there])) as cluster,
        pytest.raises(WorkersError, match=f"on the worker tcp.* {there}.*the same everywhere"),
        dask_executor(cluster.scheduler_address),
    ):
        pass


def test_a_scheduler_that_is_not_there(monkeypatch):
    pytest.importorskip("distributed", reason="the extra `distributed` is not installed")
    monkeypatch.setattr("femupdate.workers._CONNECT_S", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(WorkersError, match="no Dask scheduler answers"), dask_executor(address):
        pass
    with pytest.raises(WorkersError, match="no Dask scheduler answers"), dask_executor("a b"):
        pass
