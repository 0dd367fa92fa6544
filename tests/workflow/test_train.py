"""train: skipped, refused, and which surrogate is taken for which building."""

import shutil

import pytest

import femupdate
from femupdate.errors import SurrogateError
from femupdate.study import Study
from femupdate.surrogate import TrainingSettings, find_surrogate, load_surrogate, require_surrogate
from femupdate.surrogate.training import check_samples
from femupdate.workflow import open_study, train_study
from tests.helpers import snapshot

SAMPLES, EPOCHS = 400, 5
SMALL = TrainingSettings(epochs=EPOCHS, batch=64)
STIFFER = ('stiffness = "4 MN/m"', 'stiffness = "5 MN/m"')


@pytest.fixture(scope="module")
def trained(tmp_path_factory, tower_file):
    """A training: its study and its report."""
    study = Study(tmp_path_factory.mktemp("trained") / "study")
    model = open_study(study, str(tower_file))
    return study, train_study(study, model, SAMPLES, SMALL)


@pytest.fixture
def copy(trained, tmp_path):
    return Study(shutil.copytree(trained[0].folder, tmp_path / "copy"))


def test_what_is_written(trained):
    study, report = trained
    assert report.trained
    assert report.path == study.path("surrogate.safetensors")
    assert report.dataset_seconds > 0.0
    assert report.training_seconds > 0.0
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


def test_a_device_that_is_not_there(tmp_path):
    with pytest.raises(SurrogateError, match="the device abacus cannot be used"):
        femupdate.train(tmp_path / "new", "shear_3dof", device="abacus")
    assert not (tmp_path / "new").exists()


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
