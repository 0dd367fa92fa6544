"""A base that turns, and one that moves across, from files to predictions."""

import copy

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document, save_building
from femupdate.dynamics import ConstantDamping, Excitation, driven_system
from femupdate.effects import structure_of
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
from tests import documents
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


FACTORS, DAMPING = (0.8, 1.2), 0.02


def unsymmetric():
    """A frame of two stories that moves along y, with a wall across that at one side."""
    made = documents.frame(
        {"A": 0.0, "B": 6.0},
        {"1": 0.0, "2": 5.0},
        {"S1": 3.6, "S2": 3.2},
        size=2.5,
        grid=(0.1, 150),
        direction="y",
        slabs=[{"x": ["A", "B"], "y": ["1", "2"], "thickness": 0.2}],
    )
    made["walls"] = [{"along": "1", "from": "A", "to": "B", "thickness": 0.2}]
    made["sensors"]["points"] = ["B-2"]
    return made


def with_equal_sides():
    made = copy.deepcopy(unsymmetric())
    made["walls"].append(made["walls"][0] | {"along": "2"})
    made["sensors"]["points"] = ["A-1", "B-2"]
    return made


def test_floors_follow_as_a_direct_solution_says():
    """Against one complex solution a frequency of M u'' + C u' + K u = -M i_x x''."""
    structure, ratio = structure_of(from_document(unsymmetric())), 0.03
    frequency = np.array([0.7, 3.0, 5.2, 9.0])
    full = driven_system(
        structure, [], np.array(FACTORS), np.zeros(0), 20.0, ConstantDamping(), columns=3
    )
    none = torch.zeros(1, 0, dtype=torch.float64)
    zeta = torch.tensor([ratio], dtype=torch.float64)
    asked = none, zeta, none, torch.from_numpy(frequency)
    found = full.system.respond(Excitation(columns=3), *asked)[0, :, 2].numpy()
    K, M = structure.stiffness(FACTORS).toarray(), structure.mass.toarray()
    inverse, shapes = eigh(M, K)  # of unit stiffness, so that what has no mass has zeros
    moving = inverse > 1e-12
    of_mass = M @ shapes[:, moving] / np.sqrt(inverse[moving])
    C = of_mass * (2.0 * ratio / np.sqrt(inverse[moving])) @ of_mass.T
    # The mass that foundations share with what stands on them moves, too.
    along_x = structure.meshed[1].inertia(0)
    for number, omega in enumerate(2.0 * np.pi * frequency):
        u = np.linalg.solve(K + 1j * omega * C - omega**2 * M, -along_x)
        exact = -(omega**2) * structure.floor_rows @ u
        np.testing.assert_allclose(found[:, number], exact, atol=2e-3 * np.abs(exact).max())


def shaken_across(seed):
    asked = {"duration_s": 60.0, "sampling_hz": 60.0, "band_hz": (0.3, 20.0), "mesh_size": 2.5}
    asked |= {
        "theta": FACTORS,
        "zeta": DAMPING,
        "across_rms": 0.3,
        "sensors": ("B-2",),
        "seed": seed,
    }
    return simulate_observation(from_document(unsymmetric()), SimulationSettings(**asked)).histories


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("across")
    save_building(from_document(unsymmetric()), folder / "side.toml")
    for seed, name in enumerate(("first", "second")):
        both = shaken_across(seed)
        write_observation_histories(folder / f"{name}.csv", both)
        kept = [k for k, to in enumerate(both.channels) if to.name != "base"]
        alone = type(both)(
            both.time_step, tuple(both.channels[k] for k in kept), both.acceleration[kept]
        )
        write_observation_histories(folder / f"{name}_alone.csv", alone)
    return folder


def calibrated(place, name):
    study = Study(place / f"study_{name}")
    model = open_study(study, str(place / "side.toml"))
    settings = CalibrationSettings(exact=True, particles=400, chains=1)
    source = ObservationSource(place / f"{name}.csv")
    return study, model, calibrate_study(study, model, source, settings)


def test_what_comes_across_is_an_input_and_not_noise(place):
    study, model, both = calibrated(place, "first")
    _, _, alone = calibrated(place, "first_alone")
    assert any("base is an input" in note for note in both.notes)
    assert any("without a column base it counts as noise" in note for note in alone.notes)
    theta, seen = both.posterior.samples, both.posterior.observation
    assert np.abs((theta.mean(axis=0) - FACTORS) / theta.std(axis=0)).max() < 2.5
    used = seen.valid & alone.posterior.observation.valid
    ratio = alone.posterior.observation.noise_sd[used] / seen.noise_sd[used]
    assert np.median(ratio) > 1.5
    errors = {}
    for name in ("second", "second_alone"):
        done = predict_study(
            study,
            model,
            RecordSource(place / f"{name}.csv"),
            PredictionSettings(samples=20),
            measured=place / f"{name}.csv",
        )
        errors[name] = max(of["relative_error"] for of in done.comparison.values())
        assert any("which the record lacks" in note for note in done.notes) == ("_" in name)
    # What is left is of the mesh, on which the truth is made: it is coarser than the model's.
    assert errors["second"] < 0.15
    assert errors["second_alone"] > 3.0 * errors["second"]


def test_a_symmetric_building_has_no_such_input(place, tmp_path):
    save_building(from_document(with_equal_sides()), tmp_path / "even.toml")
    model = open_study(Study(tmp_path / "study"), str(tmp_path / "even.toml"))
    assert model.reduced.across is None


def test_a_record_has_its_motion_across_in_every_form(place):
    motion = read_record(place / "first.csv", direction="y")
    assert motion.channel == "base.y"
    assert motion.inputs.shape == (3, len(motion.acceleration))
    assert not motion.inputs[1].any()
    assert motion.scaled(2.0).across == pytest.approx(2.0 * motion.across)
    assert read_record(place / "first_alone.csv").across is None
