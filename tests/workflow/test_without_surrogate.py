"""Buildings that no surrogate serves: calibrated by the likelihood of the data, never trained."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.building import load_building
from femupdate.dynamics import floor_histories
from femupdate.errors import SurrogateError
from femupdate.inference import Parameters
from femupdate.measurement import GroundMotion
from femupdate.report import draw
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    calibrate_study,
    check_calibration,
    check_training,
    open_study,
    open_system,
    predict_study,
)
from femupdate.workflow.likelihoods import unserved
from tests.helpers import write_record
from tests.sticks import write_stick

EFFECTS = (("added_mass", "3F"), ("foundation_rocking", "base"), ("channel_gain", "RF"))
THETA, SIZES, ZETA, NOISE = (0.8, 1.4, 1.1), (0.15, 0.12, -0.06), 0.04, 0.2


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A study whose building lists effects, calibrated without --exact, and the report."""
    home = tmp_path_factory.mktemp("effects")
    study = Study(home / "study")
    model = open_study(study, str(write_stick(home / "three.toml", *EFFECTS)))
    both = torch.tensor([[*THETA, *SIZES]], dtype=torch.float64)
    zeta = torch.tensor([ZETA], dtype=torch.float64)
    clean = open_system(study, model).log_frf(both, zeta, model.frequency_hz)[0].numpy()
    noisy = np.exp(clean + NOISE * np.random.default_rng(2).standard_normal(clean.shape))
    path = home / "observed.csv"
    table = np.column_stack([model.frequency_hz.numpy(), *noisy])
    np.savetxt(path, table, delimiter=",", header="frequency_hz,2F,3F,RF", comments="")
    source, settings = ObservationSource(path), CalibrationSettings(particles=2000)
    check_calibration(study, source, settings)
    return study, calibrate_study(study, model, source, settings)


def test_a_building_with_effects_is_calibrated_by_its_data(calibrated):
    study, report = calibrated
    posterior = report.posterior
    assert posterior.drawn.likelihood == "exact"
    assert "three lists effects" in " ".join(report.notes)
    assert posterior.names[3:] == tuple(f"{name}@{place}.size" for name, place in EFFECTS)
    mean, sd = posterior.samples.mean(axis=0), posterior.samples.std(axis=0)
    assert (np.abs(mean - np.array([*THETA, *SIZES])) < 4.0 * sd).all()
    assert report.misfit == pytest.approx(1.0, abs=0.2)
    more = Parameters.uniform(
        [f"{effect}2" for effect in posterior.names[3:]], [-1.0] * 3, [1.0] * 3
    )
    values = np.concatenate([posterior.values, posterior.values[..., 3:6]], axis=2)  # 9 and damping
    posterior = replace(posterior, parameters=posterior.parameters + more, values=values)
    told = replace(report, posterior=posterior).first[1]
    assert "exact): 3 stiffness factors in the table, Added mass at 3F" in told
    pictures = draw(report, study.result("pictures"))
    assert {path.name for path in pictures} >= {"frf_fit.png", "posterior.png"}


def test_predict_takes_the_posterior_of_effects(calibrated, tmp_path):
    """Floors move as in the building that was observed, whatever one of their sensors reads."""
    study, time = calibrated[0], 0.01 * np.arange(1500)
    wave = np.exp(-(((time - 4.0) / 1.2) ** 2)) * np.sin(2 * np.pi * 5.0 * time + 0.3)
    record = write_record(tmp_path / "wave.csv", GroundMotion(wave, 0.01))
    model = open_study(study)
    report = predict_study(study, model, RecordSource(record), PredictionSettings(samples=100))
    system = open_system(study, model)
    truth = floor_histories(system, np.array([[*THETA, *SIZES]]), ZETA, wave, 0.01)
    peak = np.abs(truth.floor_acceleration[0]).max(axis=1)
    found = report.peak_acceleration
    assert (np.abs(found.mean - peak) < 4.0 * found.sd).all()
    np.testing.assert_allclose(found.mean, peak, rtol=0.1)


def test_a_building_with_effects_is_not_trained(tmp_path):
    study = Study(tmp_path / "study")
    listed = str(write_stick(tmp_path / "damped.toml", ("story_damper", "2F")))
    with pytest.raises(SurrogateError, match=r"three lists effects, .*`femupdate calibrate`"):
        check_training(study, 1000, 64, building=listed)
    assert not study.folder.exists()


@pytest.mark.parametrize(("stories", "words"), [(9, ""), (10, "has 11 parameters")])
def test_many_parameters_take_no_surrogate(tmp_path, stories, words):
    """Each story has a factor, and the damping ratio is free."""
    building = load_building(str(write_stick(tmp_path / "three.toml")))
    high = building.model_copy(update={"stories": building.stories[:1] * stories})
    assert unserved(high) == words
