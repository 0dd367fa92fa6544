"""A base whose rotation two vertical sensors measure: from a simulated file to a prediction."""

import numpy as np
import pytest

from femupdate.building import from_document, save_building
from femupdate.errors import BuildingError, MeasurementError
from femupdate.inference import load_posterior
from femupdate.measurement import read_record, write_observation_histories
from femupdate.simulation import SimulationSettings, simulate_observation
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    calibrate_study,
    check_calibration,
    diagnose_study,
    open_study,
    predict_study,
)
from femupdate.workflow.calibration_report import predictive_log_frf
from tests.documents import stick

THETA, ZETA = (0.8, 1.2, 0.9), 0.02
TURNS = "foundation_rocking and table_pitch are not looked for"
NO_HEIGHT = {"name": "S1", "mass": 180e3, "stiffness": 150e6}


def document(**changes):
    heights, springs = (4.0, 3.2, 3.5), (200e6, 180e6, 120e6)
    prior = {"theta": {"lower": 0.4, "upper": 2.5}, "zeta": {"lower": 0.005, "upper": 0.06}}
    grid = {"start": 0.2, "step": 0.1, "count": 100}
    made = stick([180e3] * 3, springs, heights, name="rocker", prior=prior, frequency_grid=grid)
    return made | changes


def simulated(**changes):
    """A minute of white noise under a base that turns, half with its translation."""
    asked = {
        "theta": THETA,
        "zeta": ZETA,
        "duration_s": 60.0,
        "sampling_hz": 50.0,
        "band_hz": (0.3, 20.0),
        "rotation_rms": 0.02,
        "vertical_at": (-1.5, 2.5),
        "seed": 4,
    }
    building = from_document(document())
    return simulate_observation(building, SimulationSettings(**{**asked, **changes}))


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rotation")
    save_building(from_document(document()), folder / "rocker.toml")
    both = simulated().histories
    write_observation_histories(folder / "both.csv", both)
    kept = [k for k, one in enumerate(both.channels) if one.place is None]
    channels = tuple(both.channels[k] for k in kept)
    alone = type(both)(both.time_step, channels, both.acceleration[kept])
    write_observation_histories(folder / "alone.csv", alone)
    return folder


@pytest.fixture(scope="module")
def study(home):
    return Study(home / "study")


@pytest.fixture(scope="module")
def model(home, study):
    return open_study(study, str(home / "rocker.toml"))


@pytest.fixture(scope="module")
def report(home, study, model):
    # What the surrogate does not know goes the exact way without being asked.
    settings = CalibrationSettings(particles=400, chains=1)
    return calibrate_study(study, model, ObservationSource(home / "both.csv"), settings)


def test_factors_lie_in_their_intervals_where_the_rotation_is_given(report):
    theta = report.posterior.samples
    # Eight standard deviations would be .02: the data are good.
    assert np.abs((theta.mean(axis=0) - THETA) / theta.std(axis=0)).max() < 2.5
    assert np.all(theta.std(axis=0) < 0.004)
    assert report.posterior.drawn.exact
    assert abs(report.posterior.zeta_samples.mean() - ZETA) < 0.001
    assert any("measured by vertical sensors at -1.5, 2.5 m" in note for note in report.notes)


def test_the_kept_observation_is_drawn_with_the_rotation(report, model):
    """What pictures show of a stored posterior lies on what was measured."""
    kept = load_posterior(report.path)
    np.testing.assert_array_equal(kept.observation.beside, report.posterior.observation.beside)
    predicted = predictive_log_frf(model.system, model, kept, count=5).mean(axis=0)
    away = (predicted - kept.observation.log_frf)[kept.observation.valid]
    assert np.median(np.abs(away)) < 0.02


def test_nothing_is_missing_where_the_rotation_is_given(home, study, model, report):
    found = diagnose_study(study, model, ObservationSource(home / "both.csv"))
    assert found.diagnosis.verdict == "none"
    assert any(TURNS in note for note in found.screen)
    # Floors do not follow the base at low frequency; a rigid building on this base does neither.
    assert not any("times as much" in note for note in found.screen)


def test_a_table_that_pitches_is_named_where_the_columns_are_dropped(home, study, model, report):
    found = diagnose_study(study, model, ObservationSource(home / "alone.csv"))
    assert found.diagnosis.verdict in ("named", "partly")
    assert found.diagnosis.findings[0].placed.label == "table_pitch@base"


def test_a_record_of_both_motions_is_predicted_by_both(home, study, model, report):
    settings = PredictionSettings(samples=20)
    errors = {}
    for name in ("both", "alone"):
        done = predict_study(
            study,
            model,
            RecordSource(home / f"{name}.csv", scale=2.0),
            settings,
            measured=home / "both.csv",
        )
        errors[name] = [of["relative_error"] for of in done.comparison.values()]
        assert any("The base turns" in note for note in done.notes) == (name == "both")
    assert max(errors["both"]) < 0.05
    assert min(errors["alone"]) > 5.0 * max(errors["both"])


def test_a_record_has_its_rotation_in_every_form(home):
    motion = read_record(home / "both.csv")
    assert motion.channel == "base"
    assert motion.inputs.shape == (2, len(motion.acceleration))
    assert motion.rotation.std() == pytest.approx(0.02, rel=0.1)
    assert motion.scaled(-2.0).rotation == pytest.approx(-2.0 * motion.rotation)
    assert len(motion.resampled(0.04).rotation) == len(motion.resampled(0.04).acceleration)
    assert read_record(home / "both.csv", channel="RF").rotation is None
    assert read_record(home / "alone.csv", channel="base").rotation is None


def test_the_simulated_file_says_what_it_is_and_bad_requests_are_refused(home):
    made = simulated()
    told = made.truth["motion"]
    assert told["rotation_rms_rad_s2"] == 0.02
    assert told["vertical_sensors_m"] == [-1.5, 2.5]
    turned = made.histories.acceleration[-1]
    assert turned.std() == pytest.approx(2.5 * 0.02, rel=0.1)
    with pytest.raises(MeasurementError, match="stand at one place"):
        simulated(vertical_at=(1.0, 1.0))
    with pytest.raises(MeasurementError, match="above zero"):
        simulated(rotation_rms=0.0)
    with pytest.raises(BuildingError, match="S1 has no height"):
        simulate_observation(
            from_document(document(stories=[NO_HEIGHT])), SimulationSettings(rotation_rms=0.1)
        )


def test_heights_are_asked_for_before_anything_is_written(home, tmp_path):
    stories = [{k: v for k, v in one.items() if k != "height"} for one in document()["stories"]]
    path = tmp_path / "flat.toml"
    save_building(from_document(document(stories=stories)), path)
    study = Study(tmp_path / "study")
    with pytest.raises(BuildingError, match="S1 has no height"):
        check_calibration(
            study, ObservationSource(home / "both.csv"), CalibrationSettings(), str(path)
        )
    assert not study.folder.exists()
