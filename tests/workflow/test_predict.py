"""predict against an integration by scipy, the truth, and the same motion in other formats."""

import json

import numpy as np
import pytest

from femupdate.errors import BuildingError, MeasurementError
from femupdate.inference import load_posterior
from femupdate.measurement import GroundMotion
from femupdate.report import plus_minus
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    calibrate_study,
    open_study,
    predict_study,
)
from tests.helpers import write_record

STEP = 0.02
FEW = PredictionSettings(samples=20)


@pytest.fixture(scope="module")
def wave():
    """A shaking that is not symmetric in time or sign, m/s2, well below the Nyquist frequency."""
    time = np.arange(700) * STEP
    swell = (1 - np.exp(-0.8 * time)) * np.exp(-0.25 * time)
    return swell * (1.9 * np.sin(22.0 * time + 0.4) + 0.8 * np.sin(55.0 * time) + 0.2)


@pytest.fixture(scope="module")
def record(tmp_path_factory, wave):
    return write_record(
        tmp_path_factory.mktemp("record") / "wave.csv", GroundMotion(wave, STEP, channel="EW")
    )


def predicted(study, model, path, settings=FEW, **options):
    source = {name: options.pop(name) for name in ("unit", "channel", "scale") if name in options}
    return predict_study(study, model, RecordSource(path, **source), settings, **options)


def test_members_that_a_stick_lacks_are_refused_before_any_work(tower_file, record, tmp_path):
    study = Study(tmp_path / "study")  # which has no posterior either
    settings = PredictionSettings(members=((0.0, 0.0, 3.0),))
    with pytest.raises(BuildingError, match="a shear building has no members"):
        predicted(study, open_study(study, str(tower_file)), record, settings)


def test_a_record_whose_steps_show_no_mode_is_refused(tower, tower_model, wave, tmp_path):
    rows = [f"{5.0 * k:g},{a:.6f}" for k, a in enumerate(wave)]
    (tmp_path / "ms.csv").write_text("\n".join(["time_s,acc (m/s2)", *rows]) + "\n")
    with pytest.raises(MeasurementError, match=r"every 5 s .* lowest frequency; is the time"):
        predicted(tower, tower_model, tmp_path / "ms.csv")


def test_an_offset_of_the_record_is_taken_off(record, wave, tmp_path):
    moved = write_record(tmp_path / "moved.csv", GroundMotion(wave - 0.5, STEP, channel="EW"))
    found = RecordSource(moved).motion().acceleration
    np.testing.assert_allclose(found, wave - wave.mean(), atol=1e-5)  # digits of the file
    np.testing.assert_allclose(RecordSource(record).motion().acceleration, wave, atol=1e-5)


def test_damping_is_the_posterior_s_own_unless_one_is_given(tower, tower_model, record):
    own = predicted(tower, tower_model, record)
    zeta = load_posterior(tower.path("posterior.nc")).thinned(20, 0)[:, -1].numpy()
    assert own.damping == f"{plus_minus(zeta.mean(), zeta.std())}, from the posterior"
    light, heavy = (
        predicted(tower, tower_model, record, PredictionSettings(samples=20, damping=ratio))
        for ratio in (0.01, 0.2)
    )
    assert light.damping == "0.01 in all modes"
    assert (light.peak_acceleration.mean > own.peak_acceleration.mean).all()
    assert (own.peak_acceleration.mean > heavy.peak_acceleration.mean).all()


def test_a_law_of_its_own_takes_no_ratio(tmp_path, tower_file, tower_observation, record):
    law = 'law = "rayleigh"\nratio = 0.05\nanchors = ["3 Hz", "9 Hz"]'
    text = tower_file.read_text().replace('law = "constant"\nratio = 0.05', law)
    file = tmp_path / "rayleigh.toml"
    file.write_text(text.replace("prior.zeta = { lower = 0.01, upper = 0.1 }\n", ""))
    study = Study(tmp_path / "study")
    model = open_study(study, str(file))
    settings = CalibrationSettings(particles=200, exact=True, chains=1)
    calibrate_study(study, model, ObservationSource(tower_observation.path), settings)
    assert predicted(study, model, record).damping == "the building's law"
    with pytest.raises(BuildingError, match="leave --damping out"):
        predicted(study, model, record, PredictionSettings(samples=20, damping=0.02))


def test_the_file_of_a_prediction(tower, tower_model, record, wave):
    import xarray as xr

    report = predicted(tower, tower_model, record, scale=1.5)
    with xr.open_datatree(report.path, engine="h5netcdf") as tree:
        assert set(tree.children) == {"predictions", "constant_data"}
        predictions = tree["predictions"]
        assert list(predictions["floor"].values) == ["2F", "RF"]
        assert list(predictions["story"].values) == [1, 2]
        assert predictions["acceleration_mean"].dims == ("floor", "time_s")
        np.testing.assert_allclose(predictions["time_s"].values, np.arange(700) * STEP)
        np.testing.assert_array_equal(
            predictions["acceleration_sd"].values, report.summary.acceleration_sd
        )
        assert predictions["peak_drift"].dims == ("sample", "story")
        assert predictions["story_stiffness"].shape == (20, 2)
        assert json.loads(predictions.attrs["units"])["drift"] == "m"
        np.testing.assert_allclose(
            tree["constant_data"]["base_acceleration"].values, 1.5 * wave, atol=1e-8
        )
        assert (tree.attrs["record"], tree.attrs["channel"]) == ("wave", "EW")
        assert tree.attrs["damping"] == report.damping
    artefact = tower.artefacts()["prediction"]
    assert artefact.settings["scale"] == 1.5
    assert tower.find("prediction", artefact.made_from) == report.path
