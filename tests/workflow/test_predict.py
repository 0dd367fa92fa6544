"""predict against an integration by scipy, the truth, and the same motion in other formats."""

import json

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

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
from tests.workflow.by_hand import tower_modes

MASSES, SPRINGS = np.array([3000.0, 2000.0]), np.array([4e6, 2.5e6])
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


def by_scipy(theta, zeta, wave):
    """Absolute floor accelerations (2, n) and story drifts (2, n) of the tower by lsim."""
    own, vectors = tower_modes(theta)
    omega = 2 * np.pi * own
    share = vectors.T @ MASSES
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(omega**2), -np.diag(2 * zeta * omega)]])
    B = np.concatenate([np.zeros(2), -share])[:, None]
    # Relative displacement; absolute acceleration is what the springs and dampers leave.
    C = np.vstack(
        [
            np.hstack([-vectors * omega**2, -vectors * 2 * zeta * omega]),
            np.hstack([vectors, np.zeros((2, 2))]),
        ]
    )
    # The record between its samples: the tower sees 40 points in each step, by Fourier.
    fine, factor = wave.size * 40, 40
    motion = np.fft.irfft(np.fft.rfft(wave), fine) * factor
    _, y, _ = lsim(StateSpace(A, B, C, np.zeros((4, 1))), motion, np.arange(fine) * STEP / factor)
    y = y[::factor].T
    return y[:2], np.array([y[2], y[3] - y[2]])


def test_histories_are_those_of_another_integrator(tower, tower_model, record, wave):
    settings = PredictionSettings(samples=3, seed=8)
    report = predicted(tower, tower_model, record, settings)
    draws = load_posterior(tower.path("posterior.nc")).thinned(3, 8).numpy()
    theta, zeta = draws[:, :-1], draws[:, -1]
    floors, drifts = zip(
        *(by_scipy(t, z, wave) for t, z in zip(theta, zeta, strict=True)), strict=True
    )
    # Nine digits in the record, two ways to interpolate it (the ends are no multiple of a period).
    scale = np.abs(floors).max()
    examples = report.alone.examples
    np.testing.assert_allclose(examples.floor_acceleration, floors, atol=0.01 * scale)
    np.testing.assert_allclose(examples.story_drift, drifts, atol=0.01 * np.abs(drifts).max())
    np.testing.assert_allclose(
        report.alone.peak_acceleration, np.abs(floors).max(axis=-1), rtol=0.01
    )
    np.testing.assert_allclose(
        report.alone.acceleration_mean, np.mean(floors, axis=0), atol=0.01 * scale
    )


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


@pytest.fixture(scope="module")
def base(tmp_path_factory, tower_observation):
    """The base motion of the tower's observation as a record."""
    histories = tower_observation.histories
    motion = GroundMotion(histories.acceleration[0], histories.time_step)
    return write_record(tmp_path_factory.mktemp("base") / "base.csv", motion)


def test_prediction_meets_what_was_measured(tower, tower_model, base, tower_observation):
    report = predicted(
        tower, tower_model, base, PredictionSettings(samples=50), measured=tower_observation.path
    )
    comparison = report.comparison
    assert comparison.floors == ("2F", "RF")
    # Sensor noise is 0.003 m/s2 on floors that move by some 0.5 m/s2 rms, and the base's own noise
    # is amplified like the motion: two hundredths of it.
    assert (comparison.relative_error < 0.04).all()
    assert (comparison.correlation > 0.999).all()
    np.testing.assert_allclose(comparison.peak_ratio, 1.0, atol=0.05)
    assert ((comparison.within_band > 0.05) & (comparison.within_band <= 1.0)).all()


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
