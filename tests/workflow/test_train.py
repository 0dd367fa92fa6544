"""train: skipped, resumed, refused, and which surrogate is taken for which building."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open

from femupdate.errors import SurrogateError
from femupdate.study import Study
from femupdate.surrogate import TrainingSettings, find_surrogate, load_surrogate, require_surrogate
from femupdate.surrogate.training import check_samples
from femupdate.workflow import open_study, train_study
from tests.helpers import Recorded, snapshot

SAMPLES, EPOCHS = 400, 5
SMALL = TrainingSettings(epochs=EPOCHS, batch=64)
STIFFER = ('stiffness = "4 MN/m"', 'stiffness = "5 MN/m"')


@pytest.fixture(scope="module")
def one_thread():
    """Sums come out the same to the last bit only where they are taken in the same order."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def trained(tmp_path_factory, tower_file, one_thread):
    """A training that was never stopped: its study and its report."""
    study = Study(tmp_path_factory.mktemp("trained") / "study")
    model = open_study(study, str(tower_file))
    return study, train_study(study, model, SAMPLES, SMALL)


@pytest.fixture
def copy(trained, tmp_path):
    return Study(shutil.copytree(trained[0].folder, tmp_path / "copy"))


def weights(path):
    with safe_open(path, framework="np") as file:
        return {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118


def header(path):
    with safe_open(path, framework="np") as file:
        return json.loads(file.metadata()["femupdate"])


def test_what_is_written(trained):
    study, report = trained
    assert report.trained
    assert report.path == study.path("surrogate.safetensors")
    assert report.dataset_seconds > 0.0
    assert report.training_seconds > 0.0
    # Neither shards nor checkpoint stay behind.
    assert {path.name for path in study.folder.iterdir()} == {
        "building.toml",
        "reduced_model.npz",
        "study.json",
        "surrogate.safetensors",
    }
    info = load_surrogate(report.path).info
    assert (info.building, info.floors, info.noise_sd) == ("tower", ("2F", "RF"), 0.2)
    assert info.mechanics_hash == open_study(study).hash
    assert info.settings["samples"] == SAMPLES
    assert info.settings["training"]["epochs"] == EPOCHS
    assert 1 <= info.metrics["best_epoch"] <= EPOCHS


def test_a_second_training_is_skipped(copy):
    before = snapshot(copy.folder)
    report = train_study(copy, open_study(copy), SAMPLES, SMALL)
    assert not report.trained
    assert report.path == copy.path("surrogate.safetensors")
    assert snapshot(copy.folder) == before


def command(study, *options):
    script = Path(sys.executable).with_name("femupdate")
    words = ("train", "--samples", SAMPLES, "--epochs", EPOCHS, "--batch", 64, "--study", study)
    return [str(script), *map(str, (*words, *options))]


def wait_for(path, process):
    until = time.monotonic() + 300.0
    while time.monotonic() < until:
        if path.exists():
            return
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    raise AssertionError(f"{path} does not appear")


@pytest.mark.usefixtures("one_thread")
def test_a_killed_training_goes_on_to_the_same_surrogate(trained, tmp_path, tower_file):
    study = Study(tmp_path / "study")
    process = subprocess.Popen(
        command(study.folder, "--building", tower_file),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    try:
        wait_for(study.path("training.safetensors"), process)
        process.kill()
    finally:
        process.wait()
    process.stderr.close()
    assert process.returncode == -signal.SIGKILL
    assert not study.path("surrogate.safetensors").exists()
    assert find_surrogate(study, open_study(study).building) is None

    told = Recorded()
    report = train_study(study, open_study(study), SAMPLES, SMALL, progress=told)
    epochs = [note.split(",")[0] for note in told.notes]
    assert "epoch 1" not in epochs
    assert f"epoch {EPOCHS}" in epochs
    straight = trained[1]
    once, again = weights(straight.path), weights(report.path)
    assert once.keys() == again.keys()
    for name, value in once.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)
    # The time that it took is all that tells the two files apart.
    written, expected = header(report.path), header(straight.path)
    for content in (written, expected):
        content["metrics"].pop("seconds", None)
    assert written == expected
    # A killed command leaves its lock, which the next one takes.
    left = {path.name for path in study.folder.iterdir() if not path.name.startswith(".lock")}
    assert left == {path.name for path in straight.path.parent.iterdir()}


@pytest.mark.parametrize(("samples", "batch", "fits"), [(110, 105, False), (111, 105, True)])
def test_samples_must_fill_a_batch(samples, batch, fits):
    """A twentieth is held out: 6 of 110 and of 111."""
    settings = TrainingSettings(batch=batch)
    if fits:
        check_samples(samples, settings)
    else:
        with pytest.raises(SurrogateError, match="110 samples are too few for batches of 105"):
            check_samples(samples, settings)


def test_the_study_s_own_surrogate_is_taken_while_it_fits(copy, tower_file):
    model = open_study(copy)
    found = find_surrogate(copy, model.building)
    assert found is not None
    assert found[1] == copy.path("surrogate.safetensors")
    assert require_surrogate(copy, model.building).info.building == "tower"
    copy.path("building.toml").write_text(tower_file.read_text().replace(*STIFFER))
    assert find_surrogate(copy, open_study(copy).building) is None


@pytest.mark.parametrize("keep", [0, 100, -1])
def test_a_surrogate_cut_short_is_not_taken(copy, keep):
    path = copy.path("surrogate.safetensors")
    path.write_bytes(path.read_bytes()[:keep])
    assert find_surrogate(copy, open_study(copy).building) is None
