"""The whole way from hidden effects in histories to a repaired study that every command takes."""

import json
import shutil
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.effects import CATALOGUE
from femupdate.errors import MeasurementError
from femupdate.inference import load_posterior
from femupdate.measurement import GroundMotion
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    calibrate_study,
    open_study,
    predict_study,
    repair_study,
)
from tests.chains import Chain
from tests.helpers import write_record
from tests.sticks import MASSES, SPRINGS, STEP, write_shaken, write_stick

THETA, ZETA = np.array([0.8, 1.4, 1.1]), 0.04
MORE = np.array([1.0, 1.12, 1.0])  # 12 % on 3F
CHAIN = Chain(MASSES, THETA * SPRINGS, zeta=ZETA)
HEAVY = CHAIN.but(masses=MASSES * MORE)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("repair")
    write_stick(folder / "three.toml")
    write_shaken(folder / "heavy.csv", HEAVY, 1)
    write_shaken(folder / "kept.csv", HEAVY, 2, hum=0.3)
    write_shaken(folder / "plain.csv", CHAIN, 3)
    return folder


@pytest.fixture(scope="module")
def calibrated_before(home):
    """A study of the plain model with a posterior from the data that it cannot explain."""
    study = Study(home / "study")
    model = open_study(study, str(home / "three.toml"))
    settings = CalibrationSettings(particles=200, exact=True, chains=2)
    calibrate_study(study, model, ObservationSource(home / "heavy.csv"), settings)
    return study


@pytest.fixture(scope="module")
def repaired(home, calibrated_before):
    """The report of the repair, and the study's own files before it."""
    study = calibrated_before
    before = {p: study.path(p).read_bytes() for p in ("building.toml", "posterior.nc")}
    report = repair_study(
        study,
        open_study(study),
        ObservationSource(home / "heavy.csv"),
        ObservationSource(home / "kept.csv"),
    )
    return report, before


def test_the_missing_mass_is_added_with_its_size(repaired):
    report = repaired[0]
    assert report.repair.verdict == "repaired"
    (one,) = report.repair.rounds
    assert one.finding.placed.label == "added_mass@3F"
    assert abs(one.finding.size - 0.12) < 3.0 * one.finding.size_sd + 0.003
    assert one.chi2_after < 0.2 * one.chi2_before
    before, after = (fit.p_value for fit in (report.repair.before, report.repair.after))
    assert after > 0.05 > before


def test_the_factors_come_back_to_the_truth_and_data_kept_out_are_predicted_better(repaired):
    """The share of the error that is the effect's goes; sensor noise and leakage stay."""
    report = repaired[0]
    draws = report.theta_before, report.theta_after
    before, after = (np.abs(theta.mean(axis=0) - THETA) for theta in draws)
    assert after.max() < 0.01
    assert before.max() > 5.0 * after.max()
    held = report.held
    assert held.name == "kept.csv"
    assert held.figures["error"][1] < 0.25 * held.figures["error"][0]
    assert held.figures["chi2"][1] < 0.2 * held.figures["chi2"][0]


def test_the_study_itself_stays_as_it_was(repaired, calibrated_before):
    _, before = repaired
    for name, content in before.items():
        assert calibrated_before.path(name).read_bytes() == content
    assert load_building(calibrated_before.path("building.toml")).effects == ()


def test_the_repaired_building_is_an_ordinary_file(repaired):
    path = repaired[0].building_path
    assert path.name == "building.toml"
    assert path.parent.name == "repaired"
    (entry,) = load_building(path).effects
    assert (entry.name, entry.place) == ("added_mass", "3F")
    written = tomllib.loads(path.read_text())["effects"][0]["parameters"]["size"]
    assert written == pytest.approx(0.12, abs=0.01)


def test_the_repaired_posterior_has_the_effect_as_a_parameter(repaired):
    report = repaired[0]
    posterior = load_posterior(report.study.path("posterior.nc"))
    assert posterior.names == ("theta_1", "theta_2", "theta_3", "added_mass@3F.size")
    mean, sd = posterior.theta[..., 3].mean(), posterior.theta[..., 3].std()
    assert mean == pytest.approx(report.repair.rounds[0].finding.size, abs=3.0 * sd)
    np.testing.assert_allclose(
        posterior.theta[..., :3].reshape(-1, 3).mean(axis=0), THETA, rtol=0.01
    )


@pytest.fixture(scope="module")
def listed(home):
    """Calibrated with a late roof listed and more mass on 3F not, of data that have both."""
    rows = (home / "heavy.csv").read_text().splitlines()
    head, values = rows[:2], np.array([row.split(",") for row in rows[2:]])
    values[:, 4] = np.roll(values[:, 4], 1)
    lines = [*head, *(",".join(row) for row in values)]
    (home / "late.csv").write_text("\n".join(lines) + "\n")
    effect = '[[effects]]\nname = "channel_delay"\nplace = "RF"\n'
    (home / "late.toml").write_text((home / "three.toml").read_text() + effect)
    study = Study(home / "listed")
    model = open_study(study, str(home / "late.toml"))
    settings = CalibrationSettings(particles=400, exact=True)
    return study, calibrate_study(study, model, ObservationSource(home / "late.csv"), settings)


def test_a_listed_delay_is_found_by_the_phase(listed):
    """Late by a sample; amplitudes say nothing of it."""
    delay = load_posterior(listed[1].path).samples[:, 3]
    assert delay.mean() == pytest.approx(STEP, rel=0.15)
    assert delay.std() < 0.1 * STEP


def test_what_such_a_model_errs_by_goes_with_its_posterior(listed, tmp_path):
    posterior = load_posterior(listed[1].path)
    assert posterior.model_error.amplitude.size > 0.02
    assert posterior.model_error.amplitude.mean.shape == posterior.observation.log_frf.shape
    assert posterior.model_error.phase.mean.shape == posterior.observation.log_frf.shape
    assert any("something is missing in the model" in one for one in posterior.warnings)
    assert listed[1].notes[: len(posterior.warnings)] == posterior.warnings
    time = np.arange(1500) * STEP
    wave = np.exp(-(((time - 4.0) / 1.2) ** 2)) * np.sin(2 * np.pi * 3.0 * time)
    record = write_record(tmp_path / "wave.csv", GroundMotion(wave, STEP))
    settings = PredictionSettings(samples=40, scatter=0.0, damping_scatter=0.0)
    study = listed[0]
    report = predict_study(study, open_study(study), RecordSource(record), settings)
    wide, narrow = (one.acceleration_sd.max() for one in (report.summary, report.alone))
    assert wide > 1.5 * narrow
    assert set(posterior.warnings) < set(report.notes)


def test_the_report_has_the_promised_keys_and_its_file(repaired):
    report = repaired[0]
    told = report.as_dict()
    assert told["holdout_error_after"] < 0.02 < 0.05 < told["holdout_error_before"]
    settled = told["rounds"][0]["settled_by"]
    assert settled == CATALOGUE["added_mass"].settled_by
    assert f"\n  without the model it is settled by {settled}\n" in "\n".join(report.lines(True))
    worse = replace(report.held, figures={**report.held.figures, "own_error": (0.5, 0.6)})
    for held, wrong in ((report.held, False), (worse, True)):
        assert ("may not serve" in "".join(replace(report, held=held).lines())) == wrong
    assert told["chi2_before"] == told["rounds"][0]["chi2_before"]
    assert told["building"] == str(report.building_path)
    assert json.loads(report.path.read_text())["rounds"][0]["effect"] == "added_mass"


def test_nothing_is_added_where_nothing_is_missing(home, tmp_path):
    study = Study(tmp_path / "plain")
    model = open_study(study, str(home / "three.toml"))
    report = repair_study(study, model, ObservationSource(home / "plain.csv"))
    assert report.repair.verdict == "none"
    assert report.repair.rounds == ()
    assert report.building_path is None
    assert report.study is None
    assert not study.path("repaired").exists()
    told = report.as_dict()
    assert told["building"] is None
    assert told["rounds"] == []
    assert told["chi2_before"] == told["chi2_after"]
    assert told["holdout_error_before"] is None
    np.testing.assert_allclose(report.theta_after.mean(axis=0), THETA, rtol=0.01)


def test_data_of_another_building_leave_nothing_behind(home, tmp_path):
    other = tmp_path / "other.csv"
    text = (home / "heavy.csv").read_text()
    other.write_text(text.replace("RF", "9F", 1))
    study = Study(tmp_path / "study")
    model = open_study(study, str(home / "three.toml"))
    files = sorted(p.name for p in study.folder.rglob("*"))
    with pytest.raises(MeasurementError, match="another building"):
        repair_study(study, model, ObservationSource(other))
    shutil.copy(home / "heavy.csv", copy := tmp_path / "copy.csv")
    with pytest.raises(MeasurementError, match=r"copy.csv is fitted, so it proves nothing; keep"):
        repair_study(study, model, ObservationSource(home / "heavy.csv"), ObservationSource(copy))
    with pytest.raises(MeasurementError, match="another building"):
        repair_study(study, model, ObservationSource(home / "heavy.csv"), ObservationSource(other))
    # Floors of the same names, but other stories: of its variation nothing is explained.
    write_shaken(other, HEAVY.but(springs=SPRINGS * THETA * [0.3, 1.0, 3.0]), 4)
    with pytest.raises(MeasurementError, match="kept out, is unlike another event of three"):
        repair_study(study, model, ObservationSource(home / "heavy.csv"), ObservationSource(other))
    assert sorted(p.name for p in study.folder.rglob("*")) == files


def test_pages_of_a_repair_name_it_and_every_file(repaired, home, tmp_path):
    from femupdate.study import file_hash
    from femupdate.workflow import study_status, write_report

    done, _ = repaired
    before, after = Study(done.path.parent), done.study
    html = write_report(before, tmp_path / "before.html").report.read_text("utf-8")
    assert "A repaired model has a page of its own. Added to it: Added mass at" in html
    assert "kept.csv" in html
    assert file_hash(home / "kept.csv")[:16] in html
    assert all(line in " ".join(html.split()) for line in study_status(before).first)
    html = write_report(after, tmp_path / "after.html").report.read_text("utf-8")
    told = " ".join(html.replace("&#39;", "'").split())
    assert all(line in told for line in study_status(after).first)
    assert "This model was repaired. Added to it: Added mass at" in html
    assert "share of the floor's" in told
    # Data kept out made no artefact of the repaired study itself.
    assert file_hash(home / "kept.csv")[:16] in html


def test_what_comes_after_a_repair_is_said(repaired, home):
    from femupdate.workflow import study_status

    found = study_status(Study(repaired[0].path.parent))
    again = next(one.again for one in found.holds if one.name == "repair")
    assert again.startswith("repair ")
    assert f"--holdout {home / 'kept.csv'}" in again
    kept = (home / "kept.csv").read_bytes()
    try:
        (home / "kept.csv").write_bytes(kept + b"\n")
        found = study_status(Study(repaired[0].path.parent))
        assert found.state("repair") == "stale"
    finally:
        (home / "kept.csv").write_bytes(kept)
