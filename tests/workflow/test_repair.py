"""The whole way from hidden effects in histories to a repaired study that every command takes."""

import importlib.util
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.discrepancy.repair import as_fitted
from femupdate.discrepancy.residual_map import p_value
from femupdate.dynamics import System, floor_histories
from femupdate.effects import CATALOGUE
from femupdate.errors import MeasurementError, SurrogateError
from femupdate.inference.posterior import load_posterior
from femupdate.measurement.record import GroundMotion
from femupdate.report.figure import draw
from femupdate.study import Study
from femupdate.surrogate.storage import require_surrogate
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.likelihoods import CalibrationSettings
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import predict_study
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource
from femupdate.workflow.render import render_study
from femupdate.workflow.repair import repair_study

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
THETA, ZETA, STEP = np.array([0.8, 1.4, 1.1]), 0.04, 0.01
MORE = np.array([1.0, 1.12, 1.0])  # 12 % on 3F
BUILDING = """\
name = "three"
kind = "shear"
{stories}
[frequency_grid]
start = "0.2 Hz"
step = "0.1 Hz"
count = 150

[prior.theta]
lower = 0.5
upper = 2

[prior.zeta]
lower = 0.01
upper = 0.1

[damping]
law = "constant"
ratio = 0.04
"""
STORY = '[[stories]]\nname = "S{n}"\nmass = "{m} kg"\nstiffness = "{k} N/m"\n'


def _load_chain():
    path = Path(__file__).parents[1] / "discrepancy" / "chain.py"
    spec = importlib.util.spec_from_file_location("repair_chain", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CHAIN = _load_chain().Chain(MASSES, THETA * SPRINGS, zeta=ZETA)
HEAVY = CHAIN.but(masses=MASSES * MORE)


def write_histories(path, chain, seed, factor=(1.0, 1.0, 1.0), seconds=120.0):
    """Band-limited noise through the chain's own FRFs, from rest, with sensor noise.

    The ten seconds of rest at the end let all motion die down: the circular convolution is exact.
    """
    rng = np.random.default_rng(seed)
    count = round(seconds / STEP)
    frequency = np.fft.rfftfreq(count, STEP)
    white = np.fft.rfft(rng.standard_normal(count))
    white[(frequency < 0.15) | (frequency > 18.0)] = 0.0
    base = np.fft.irfft(white, count) * (np.arange(count) < count - round(10.0 / STEP))
    frf = np.ones((4, frequency.size), dtype=complex)
    frf[1:, 1:] = chain.frf(frequency[1:])
    motion = np.fft.irfft(frf * np.fft.rfft(base), count, axis=1)
    motion *= 0.5 / base.std() * np.array([1.0, *factor])[:, None]
    motion += 0.002 * rng.standard_normal(motion.shape)
    rows = [f"{n * STEP:.2f}," + ",".join(f"{v:.7g}" for v in r) for n, r in enumerate(motion.T)]
    path.write_text("\n".join(["time_s,base,2F,3F,RF", "s,m/s2,m/s2,m/s2,m/s2", *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("repair")
    stories = "".join(
        STORY.format(n=n, m=m, k=k) for n, (m, k) in enumerate(zip(MASSES, SPRINGS, strict=True), 1)
    )
    (folder / "three.toml").write_text(BUILDING.format(stories=stories))
    write_histories(folder / "heavy.csv", HEAVY, 1)
    write_histories(folder / "kept.csv", HEAVY, 2)
    write_histories(folder / "plain.csv", CHAIN, 3)
    write_histories(folder / "both.csv", HEAVY, 4, (1.0, 1.0, 1.08))
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
    before, after = (
        p_value(fit.likelihood, fit) for fit in (report.repair.before, report.repair.after)
    )
    assert after > 0.05 > before


def test_the_factors_come_back_to_the_truth(repaired):
    report = repaired[0]
    draws = report.theta_before, report.theta_after
    before, after = (np.abs(theta.mean(axis=0) - THETA) for theta in draws)
    assert after.max() < 0.01
    assert before.max() > 5.0 * after.max()


def test_data_kept_out_are_predicted_better(repaired):
    """The share of the error that is the effect's goes; sensor noise and leakage stay."""
    held = repaired[0].held
    assert held.name == "kept.csv"
    assert held.error_after < 0.25 * held.error_before
    assert held.chi2_after < 0.2 * held.chi2_before


def test_the_study_itself_stays_as_it_was(repaired, calibrated_before):
    _, before = repaired
    for name, content in before.items():
        assert calibrated_before.path(name).read_bytes() == content
    assert load_building(calibrated_before.path("building.toml")).effects == ()


def test_a_name_that_leaves_most_of_the_misfit_is_told_with_doubt(repaired):
    """Unless data kept out carry it, or nothing is left in the end."""
    report, told = repaired[0], "may stand in for what else"
    points, first = report.problem.effective, report.repair.rounds[0]
    before = first.chi2_before
    weak = replace(first, chi2_after=before - 0.4 * (before - points))
    left = report.repair.left
    erring = replace(left, size=0.05)
    doubtful = replace(report, repair=replace(report.repair, rounds=(weak,), left=erring))
    assert told not in "\n".join(doubtful.lines())
    assert told in "\n".join(replace(doubtful, held=None).lines())
    ended = replace(doubtful, held=None, repair=replace(doubtful.repair, left=left))
    assert told not in "\n".join(ended.lines())
    assert told not in "\n".join(replace(report, held=None).lines())


def test_the_repaired_building_is_an_ordinary_file(repaired):
    path = repaired[0].building_path
    assert path.name == "building.toml"
    assert path.parent.name == "repaired"
    (entry,) = load_building(path).effects
    assert (entry.name, entry.place) == ("added_mass", "3F")
    written = tomllib.loads(path.read_text())["effects"][0]["parameters"]["size"]
    assert written == pytest.approx(0.12, abs=0.01)


def test_the_sizes_told_are_those_of_the_repaired_building(repaired):
    """Where the model is fitted anew after the last round, too."""
    done = repaired[0].repair
    (entry,) = repaired[0].building.effects
    assert done.rounds[0].finding.size == pytest.approx(entry.parameters["size"], rel=1e-5)
    stale = replace(done.rounds[0], finding=replace(done.rounds[0].finding, size=9.9))
    told = as_fitted(replace(done, rounds=(stale,))).rounds[0]
    assert told.finding.size == pytest.approx(entry.parameters["size"], rel=1e-5)
    assert told.chi2_after == pytest.approx(done.after.chi2)


def test_the_repaired_posterior_has_the_effect_as_a_parameter(repaired):
    report = repaired[0]
    posterior = load_posterior(report.study.path("posterior.nc"))
    assert posterior.names == ("theta_1", "theta_2", "theta_3", "added_mass@3F.size")
    mean, sd = posterior.theta[..., 3].mean(), posterior.theta[..., 3].std()
    assert mean == pytest.approx(report.repair.rounds[0].finding.size, abs=3.0 * sd)
    np.testing.assert_allclose(
        posterior.theta[..., :3].reshape(-1, 3).mean(axis=0), THETA, rtol=0.01
    )


def test_predict_takes_the_repaired_study(repaired, tmp_path, write_record):
    """Its histories are those of the heavier chain."""
    study = repaired[0].study
    time = np.arange(1500) * STEP
    wave = np.exp(-(((time - 4.0) / 1.2) ** 2)) * np.sin(2 * np.pi * 3.0 * time + 0.3)
    record = write_record(tmp_path / "wave.csv", GroundMotion(wave, STEP))
    report = predict_study(
        study, open_study(study), RecordSource(record), PredictionSettings(samples=20)
    )
    from femupdate.dynamics import reduce_lumped

    chain = reduce_lumped(
        np.stack([_unit(n) * SPRINGS[n] for n in range(3)]),
        np.diag(MASSES * MORE),
        ("2F", "3F", "RF"),
    )
    reference = floor_histories(System(chain), THETA[None], ZETA, wave, STEP)
    peak = np.abs(reference.floor_acceleration[0]).max(axis=1)
    np.testing.assert_allclose(report.peak_acceleration.mean, peak, rtol=0.02)


def _unit(story):
    drift = (np.eye(3) - np.eye(3, k=-1))[story]
    return np.outer(drift, drift)


def test_pictures_of_the_repaired_modes(repaired):
    study = repaired[0].study
    rendered = render_study(study, open_study(study), samples=20, seed=1).modes
    omega = HEAVY.modes[0]
    # Frequencies of the mean draw; the mass lowers them by up to 3 %.
    seen = np.array([mode.tracked.frequency_mean for mode in rendered])
    np.testing.assert_allclose(seen, omega[: len(seen)] / (2 * np.pi), rtol=0.04)


def test_calibrate_exact_takes_the_repaired_building(repaired, home, tmp_path):
    study = Study(tmp_path / "again")
    model = open_study(study, str(repaired[0].building_path))
    settings = CalibrationSettings(particles=400, exact=True)
    report = calibrate_study(study, model, ObservationSource(home / "kept.csv"), settings)
    posterior = load_posterior(report.path)
    assert posterior.names[-1] == "added_mass@3F.size"
    draws = posterior.theta.reshape(-1, 4)
    np.testing.assert_allclose(draws.mean(axis=0), [*THETA, 0.12], atol=0.015)


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


def test_what_such_a_model_errs_by_goes_with_its_posterior(listed, tmp_path, write_record):
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


def test_a_right_repair_has_no_error_to_tell(repaired):
    posterior = load_posterior(repaired[0].study.path("posterior.nc"))
    assert posterior.model_error.amplitude.present < 0.5
    assert posterior.warnings == ()


def test_a_repaired_building_without_a_surrogate_is_told_what_to_do(repaired):
    with pytest.raises(SurrogateError) as refused:
        require_surrogate(repaired[0].study, load_building(repaired[0].building_path))
    sentence = str(refused.value)
    assert "femupdate train --study" in sentence
    assert "--exact" in sentence
    assert "\n" not in sentence


def test_the_report_has_the_promised_keys_and_its_file(repaired):
    report = repaired[0]
    told = report.as_dict()
    assert {
        "rounds",
        "chi2_before",
        "chi2_after",
        "holdout_error_before",
        "holdout_error_after",
        "building",
        "verdict",
    } <= set(told)
    assert {"effect", "place", "chi2_before", "chi2_after"} <= set(told["rounds"][0])
    settled = CATALOGUE["added_mass"].settled_by
    assert told["rounds"][0]["settled_by"] == settled
    assert f"  without the model it is settled by {settled}" in report.lines()[0].splitlines()
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


def test_what_predicts_a_half_worse_by_the_other_is_not_added(home, tmp_path, monkeypatch):
    def worse(fitted):
        return 1.0 + len(fitted.placed)

    monkeypatch.setattr("femupdate.discrepancy.repair.missed_in_turn", worse)
    study = Study(tmp_path / "refused")
    model = open_study(study, str(home / "three.toml"))
    report = repair_study(study, model, ObservationSource(home / "heavy.csv"))
    assert report.repair.rounds == ()
    assert report.as_dict()["refused"] == ["added_mass@3F"]
    assert report.building_path is None
    told = "\n".join(report.lines())
    assert "not added, for data kept out are predicted worse with it: 3F carries" in told
    assert "in turn" not in told


def test_data_of_which_no_part_can_be_kept_out_are_told(repaired):
    report = replace(repaired[0], held=None, in_turn=(np.nan, np.nan))
    assert "No part of the data could be kept out" in "\n".join(report.lines())
    assert report.as_dict()["halves_chi2_after"] is None


def test_the_halves_are_not_asked_where_other_data_were_kept_out(repaired):
    report = repaired[0]
    assert report.in_turn is None
    assert report.as_dict()["halves_chi2_before"] is None
    assert "in turn" not in "\n".join(report.lines())


def test_two_effects_are_added_one_after_the_other(home, tmp_path):
    study = Study(tmp_path / "both")
    model = open_study(study, str(home / "three.toml"))
    report = repair_study(study, model, ObservationSource(home / "both.csv"))
    labels = {one.finding.placed.label for one in report.repair.rounds}
    assert labels == {"added_mass@3F", "channel_gain@RF"}
    first, second = report.repair.rounds
    assert first.chi2_before > first.chi2_after == second.chi2_before > second.chi2_after
    assert p_value(report.repair.after.likelihood, report.repair.after) > 0.05
    sizes = {e.name: e.parameters["size"] for e in load_building(report.building_path).effects}
    assert sizes["added_mass"] == pytest.approx(0.12, abs=0.01)
    assert sizes["channel_gain"] == pytest.approx(0.08, abs=0.01)


def test_a_table_of_frfs_kept_out_has_no_error_of_histories(home, calibrated_before, tmp_path):
    grid = np.arange(0.2, 15.0, 0.1)
    seen = np.abs(HEAVY.frf(grid))
    rows = [
        f"{f:.1f}," + ",".join(f"{v:.9g}" for v in c) for f, c in zip(grid, seen.T, strict=True)
    ]
    table = tmp_path / "frf.csv"
    table.write_text("\n".join(["frequency_hz,2F,3F,RF", *rows]) + "\n")
    study = Study(tmp_path / "again")
    report = repair_study(
        study,
        open_study(study, str(home / "three.toml")),
        ObservationSource(home / "heavy.csv"),
        ObservationSource(table),
    )
    assert np.isnan(report.held.error_after)
    assert report.held.chi2_after < 0.2 * report.held.chi2_before
    json.dumps(report.as_dict(), allow_nan=False)


def test_data_of_another_building_leave_nothing_behind(home, tmp_path):
    other = tmp_path / "other.csv"
    text = (home / "heavy.csv").read_text()
    other.write_text(text.replace("RF", "9F", 1))
    study = Study(tmp_path / "study")
    model = open_study(study, str(home / "three.toml"))
    files = sorted(p.name for p in study.folder.rglob("*"))
    with pytest.raises(MeasurementError, match="another building"):
        repair_study(study, model, ObservationSource(other))
    with pytest.raises(MeasurementError, match="another building"):
        repair_study(study, model, ObservationSource(home / "heavy.csv"), ObservationSource(other))
    assert sorted(p.name for p in study.folder.rglob("*")) == files


def test_pictures_of_a_repair(repaired, tmp_path):
    pictures = draw(repaired[0], tmp_path / "pictures")
    assert [path.name for path in pictures] == ["gap_residuals.png", "gap_before_after.png"]
    for path in pictures:
        assert path.stat().st_size > 5000


def test_pages_of_a_repair_name_it_and_every_file(repaired, home, tmp_path):
    from femupdate.study import file_hash
    from femupdate.workflow.report import report_study

    done, _ = repaired
    before, after = Study(done.path.parent), done.study
    html = report_study(before, tmp_path / "before.html").path.read_text("utf-8")
    assert "A repaired model has a page of its own. Added to the model: Added mass at" in html
    assert "kept.csv" in html
    assert file_hash(home / "kept.csv")[:16] in html
    html = report_study(after, tmp_path / "after.html").path.read_text("utf-8")
    assert "This model was repaired. Added to the model: Added mass at" in html
    assert re.search(r"The model holds effects: Added mass at 3F: [\d.]+ \[.*\] % \(share", html)
    # Data kept out made no artefact of the repaired study itself.
    assert file_hash(home / "kept.csv")[:16] in html


def test_a_repair_tells_stories_by_their_names(repaired):
    text = "\n".join(repaired[0].lines())
    assert re.search(r"^  story S1 +0\.\d+ ± 0\.\d+ +0\.\d+ ± 0\.\d+$", text, re.MULTILINE)
    assert "theta_" not in text


def test_what_comes_after_a_repair_is_said(repaired, home):
    from femupdate.workflow.status import study_status

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
