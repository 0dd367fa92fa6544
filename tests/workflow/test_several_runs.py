"""Several runs of one building explained by one posterior."""

import json

import numpy as np
import pytest
import torch
from femupdate.benchmarks.calibration.cases import stated_likelihood

from femupdate.building import load_building
from femupdate.errors import MeasurementError
from femupdate.inference import SmcSettings, load_posterior
from femupdate.simulation import SimulationSettings, simulate_observation, write_simulation
from femupdate.study import Study, file_hash
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    measured_of,
    open_study,
)
from tests.workflow.by_hand import GRID, grid_about, tower_frf, write_table

QUICK = CalibrationSettings(
    particles=200, exact=True, chains=2, smc=SmcSettings(moves=4, independence_moves=2)
)
TRUTH, ZETA = np.array([0.8, 1.3]), 0.05


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Two runs of the tower with noise of .1 and .15, and a third of a softer one."""
    folder, rng = tmp_path_factory.mktemp("runs"), np.random.default_rng(5)
    paths = []
    for name, theta, sd in (
        ("one", TRUTH, 0.1),
        ("two", TRUTH, 0.15),
        ("softer", 0.9 * TRUTH, 0.1),
    ):
        clean = np.log(np.abs(tower_frf(theta, ZETA, GRID)))
        noisy = clean + sd * rng.standard_normal(clean.shape)
        paths.append(write_table(folder / f"{name}.csv", noisy, sd))
    return paths


def source_of(*paths, **options):
    first, *further = paths
    return ObservationSource(first, further=tuple(further), **options)


def test_log_likelihood_and_evidence_are_those_of_both_runs(tmp_path, tower_file, tables):
    """Against the likelihoods of the runs one by one: at the draws, and summed over a grid."""
    study = Study(tmp_path)
    model = open_study(study, str(tower_file))
    source = source_of(*tables[:2])
    apart = [stated_likelihood(model, run) for run in measured_of(model.building, source).runs]
    settings = CalibrationSettings(particles=2000, exact=True)
    posterior = calibrate_study(study, model, source, settings).posterior
    draws = np.column_stack([posterior.samples, posterior.zeta_samples])
    expected = sum(one(torch.from_numpy(draws)) for one in apart).numpy()
    # Errors of the model that the data do not exclude add something, the more the worse a draw.
    np.testing.assert_allclose(posterior.log_likelihood.ravel(), expected, atol=0.3)
    points, mass = grid_about(draws)
    both = sum(one(torch.from_numpy(points)) for one in apart)
    log_evidence = float(torch.logsumexp(both, 0)) + mass
    # Four runs: their own spread says how well their mean is known.
    told = posterior.drawn
    assert told.log_evidence == pytest.approx(
        log_evidence, abs=max(4 * told.log_evidence_error, 0.2)
    )
    # Without what pooling leaves out it would be off by dozens.
    assert posterior.observation.scatter.sum() > 50.0


def test_what_is_kept_names_every_file(tmp_path, tower_model, tables):
    study = Study(tmp_path)
    report = calibrate_study(study, tower_model, source_of(*tables[:2]), QUICK)
    kept = study.artefacts()["posterior"]
    assert kept.made_from["observation"] == file_hash(tables[0])
    assert kept.made_from["observation 2"] == file_hash(tables[1])
    assert kept.settings["further"] == [str(tables[1])]
    stored = load_posterior(report.path).observation
    assert stored.source == "one.csv, two.csv"
    np.testing.assert_array_equal(stored.between, report.posterior.observation.between)
    summary = json.loads((tmp_path / "posterior_summary.json").read_text())
    assert summary["source"] == "one.csv, two.csv"
    alone = calibrate_study(study, tower_model, source_of(tables[0]), QUICK)
    assert "observation 2" not in study.artefacts()["posterior"].made_from
    assert alone.posterior.observation.between is None


def test_runs_that_do_not_agree_are_told_and_gone_on_with(tmp_path, tower_model, tables):
    report = calibrate_study(Study(tmp_path), tower_model, source_of(tables[0], tables[2]), QUICK)
    told = next(note for note in report.notes if "explained together" in note)
    assert "2 runs are explained together: one.csv, softer.csv." in told
    assert "They do not agree: softer.csv differs from one.csv at " in told
    assert "femupdate diagnose" in told
    mean = report.posterior.samples.mean(axis=0)
    assert ((mean > 0.9 * TRUTH) & (mean < TRUTH)).all()


def test_floors_may_be_of_one_run_only(tower_model, tables, tmp_path):
    clean = np.log(np.abs(tower_frf(TRUTH, ZETA, GRID)))
    roof = write_table(tmp_path / "roof.csv", clean[1:], 0.1, ("RF",))
    low = write_table(tmp_path / "low.csv", clean[:1], 0.1, ("2F",))
    both = measured_of(tower_model.building, source_of(roof, low)).base
    assert both.floors == ("2F", "RF")
    np.testing.assert_allclose(both.log_frf, clean, atol=1e-9)
    assert "cannot be told" in both.notes[0]
    source = source_of(tables[0], roof, sensors=("RF",))
    more = measured_of(tower_model.building, source).base
    assert more.floors == ("RF",)


def test_runs_that_cannot_be_taken_together(tmp_path, tower_model, tables):
    copy = tmp_path / "copy.csv"
    copy.write_text("# The same under another name.\n" + tables[0].read_text())
    other = write_table(tmp_path / "other.csv", np.zeros((1, 60)), 0.1, ("3F",))
    low = write_table(tmp_path / "low.csv", np.zeros((1, 60)), 0.1, ("2F",))
    cases = (
        ((tables[0], tables[0]), {}, "one.csv is given twice; give every run once"),
        ((tables[0], copy), {}, "copy.csv holds the same measurement as one.csv"),
        ((tables[0], other), {}, "other.csv: this is the file of another building"),
        ((*tables[:2],), {"sensors": ("7F",)}, "there is no 7F to use; the files have 2F, RF"),
        ((tables[0], low), {"sensors": ("RF",)}, "low.csv: it has none of the floors asked for"),
        ((*tables[:2],), {"band_hz": (11, 12)}, "one.csv: fewer than ten frequencies"),
    )
    for paths, options, words in cases:
        with pytest.raises(MeasurementError, match=words):
            measured_of(tower_model.building, source_of(*paths, **options))


def test_histories_of_two_earthquakes(tmp_path, tower_file):
    """Of unequal length: resolutions differ, and the truth is found."""
    building, paths = load_building(tower_file), []
    for seed, seconds in ((1, 60.0), (2, 12.0)):
        chosen = SimulationSettings(
            theta=tuple(TRUTH),
            zeta=ZETA,
            duration_s=seconds,
            sampling_hz=50.0,
            band_hz=(0.3, 20.0),
            seed=seed,
        )
        made = simulate_observation(building, chosen)
        paths.append(write_simulation(made, tmp_path / f"{seed}.csv").observation)
    study = Study(tmp_path / "study")
    model = open_study(study, str(tower_file))
    runs = measured_of(building, source_of(*paths)).runs
    assert runs[0].resolution_hz < runs[1].resolution_hz
    report = calibrate_study(study, model, source_of(*paths), QUICK)
    observation = report.posterior.observation
    assert runs[0].resolution_hz < observation.resolution_hz < runs[1].resolution_hz
    assert observation.coherence is not None
    assert (np.abs(report.posterior.samples.mean(axis=0) - TRUTH) < 0.01).all()
    assert any(note.startswith("1.csv: Welch H1") for note in report.notes)
