"""Training by two processes of torchrun, on processors (gloo)."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file

LAUNCHER = (sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone")
WORDS = ("train", "--samples", "400", "--epochs", "3", "--batch", "64")
# Rounding decides which basis of a null space the optimiser takes, and the training follows it.
# So sums are compared where they differ by 1e-15, and the optimiser takes no basis.
EXACT = """
import os, sys
import torch
from femupdate.surrogate import loss, training

torch.set_default_dtype(torch.float64)
loss.has_fast_half = lambda: False
soap = training.Soap
training.Soap = lambda groups, lr: soap([{**one, "rotate": False} for one in groups], lr)
from femupdate.cli.main import main

main()
assert "torch._dynamo" not in sys.modules
"""
LOST = (
    "Error: a process of this training was lost, or torchrun was stopped; run the same command "
    "again, which goes on from the last whole epoch"
)


@pytest.fixture(scope="module")
def train(tmp_path_factory, tower_file):
    """Run or only start the training in a study, by these words."""
    script = tmp_path_factory.mktemp("script") / "exact.py"
    script.write_text(EXACT, encoding="utf-8")

    def start(study, *launcher, only_start=False, building=tower_file):
        words = (*(launcher or (sys.executable,)), script, *WORDS)
        process = subprocess.Popen(
            [*map(str, words), "--study", str(study), "--building", str(building)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        if only_start:
            return process
        out, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
        return out, err

    return start


@pytest.fixture(scope="module")
def two(tmp_path_factory, train):
    """A study trained by two processes, and what they printed."""
    study = tmp_path_factory.mktemp("two") / "study"
    return study, *train(study, *LAUNCHER)


def weights(study):
    return load_file(study / "surrogate.safetensors")


def test_two_processes_train_as_one(two, train, tmp_path):
    """Sums in double precision, weights kept in single: 1e-6 of the largest of each."""
    study, out, err = two
    train(tmp_path / "one")
    one, other = weights(tmp_path / "one"), weights(study)
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_allclose(other[name], value, atol=1e-6 * np.abs(value).max(), rtol=0)
    # The first alone prints and writes.
    assert out.count("validation loss") == err.count("Training the MVAE ...") == 1
    left = {path.name for path in study.iterdir()}
    assert left == {path.name for path in (tmp_path / "one").iterdir()}


def test_a_lost_process_ends_all_and_the_training_goes_on(two, train, tmp_path):
    """By two processes to the same weights, and by one to the same but for rounding."""
    study = tmp_path / "study"
    process = train(study, *LAUNCHER, only_start=True)
    try:
        until = time.monotonic() + 120.0
        while not (study / "training.safetensors").exists():
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.01)
        os.kill(second_of(process.pid), signal.SIGKILL)
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode != 0
    assert err.count(LOST) == 1
    assert "femupdate/surrogate" not in err
    assert not (study / "surrogate.safetensors").exists()
    copy = Path(shutil.copytree(study, tmp_path / "copy"))
    train(study, *LAUNCHER)
    train(copy)
    for name, value in weights(two[0]).items():
        np.testing.assert_array_equal(weights(study)[name], value)
        near = 1e-6 * np.abs(value).max()
        np.testing.assert_allclose(weights(copy)[name], value, atol=near, rtol=0)


def second_of(launcher):
    """Process number of the second of the two that a launcher started."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if parent == launcher and b"\0RANK=1\0" in (folder / "environ").read_bytes():
                return int(folder.name)
        except OSError:
            continue
    raise AssertionError("the second process is not there")


@pytest.mark.parametrize("number", [0, 1])
def test_only_train_is_done_by_several(femupdate, monkeypatch, number):
    said = {"RANK": number, "WORLD_SIZE": 2, "LOCAL_RANK": number, "LOCAL_WORLD_SIZE": 2}
    for name, value in {**said, "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": 1}.items():
        monkeypatch.setenv(name, str(value))
    done = femupdate("list")
    assert done.code == 1
    if number:
        assert done.out + done.err == ""
        return
    assert done.complaint == (
        "torchrun started 2 processes, but only `train` is done by several together; run "
        "`femupdate list` without torchrun"
    )
    monkeypatch.setenv("WORLD_SIZE", "1")
    assert femupdate("list").code == 0
