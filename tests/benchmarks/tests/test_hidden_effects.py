"""A short version of the trials in which effects are hidden from the finder."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest
from femupdate.benchmarks.frame_coverage import BUILDING
from femupdate.benchmarks.hidden_effects.draw import CLEAN, ONE, OUTSIDE
from femupdate.benchmarks.hidden_effects.kinds import FORCE, MODES
from femupdate.benchmarks.hidden_effects.measurement import TrialSettings
from femupdate.benchmarks.hidden_effects.run import TrialPlan, run_hidden_effects
from femupdate.benchmarks.hidden_effects.summary import summary
from femupdate.benchmarks.hidden_effects.trial import Outcome, Trial, run_trial, trial_models
from femupdate.benchmarks.hidden_effects.uncatalogued import UNCATALOGUED
from femupdate.benchmarks.log import restored
from femupdate.benchmarks.result import Job

from femupdate.building import load_building
from femupdate.effects import CATALOGUE
from femupdate.errors import ReportError
from femupdate.simulation import fine_model
from femupdate.study import Study
from femupdate.workflow import open_study
from tests import sticks

# Numbers that no published trial has used; every outcome is a function of them.
SEED = 90
PLAN = TrialPlan(clean=1, one=2, two=0, outside=0)
# Half of a trial's record, seen at a fifth of the frequencies: seconds instead of a minute.
SHORT = TrialSettings(durations_s=(60.0,))


@pytest.fixture(scope="module")
def four_stories(tmp_path_factory):
    path = tmp_path_factory.mktemp("building") / "four_stories.toml"
    path.write_text(sticks.shear_stick(stories=4), encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory, four_stories):
    """All trials with base motion: their folder, their report and what the log holds of them."""
    folder = tmp_path_factory.mktemp("trials")
    report = run_hidden_effects(Job(folder, SEED), four_stories, PLAN, SHORT)
    log = folder / "hidden_effects_shear_4dof.jsonl"
    header, *lines = log.read_text(encoding="utf-8").splitlines()
    parts = {one["key"]: one["content"] for one in map(json.loads, lines)}
    return SimpleNamespace(report=report, log=log.name, header=header, parts=parts)


@pytest.fixture(scope="module")
def outcomes(run):
    found = [restored(Outcome, part) for part in run.parts.values()]
    return {kind: [one for one in found if one.kind == kind] for kind in (CLEAN, ONE)}


@pytest.fixture(scope="module")
def one(outcomes):
    """A trial in which something that shows was hidden."""
    return next(one for one in outcomes[ONE] if one.strength >= 6.0)


def test_nothing_is_found_where_nothing_is_hidden(outcomes):
    assert [one.verdict for one in outcomes[CLEAN]] == ["none"]


def test_what_is_hidden_and_visible_is_named_and_the_gap_closes(outcomes):
    seen = [one for one in outcomes[ONE] if one.strength >= 6.0]
    assert seen
    for one in seen:
        assert one.named == one.hidden[0]
        if one.verdict == "named":
            assert one.held_after < one.held_before


def test_the_summary_counts(outcomes):
    clean = outcomes[CLEAN]
    alarmed = [replace(clean[0], verdict="named"), *clean]
    rows = {row.what: row for row in summary(alarmed)}
    assert rows["false alarms on clean cases"].found.startswith("50.0%")
    assert rows["false alarms on clean cases"].of == 2


def test_effects_named_together_count_apart_from_the_first_name(one):
    other = {"named": "roll_off@floors", "ranking": ("roll_off@floors", one.hidden[0])}
    together = replace(one, **other, verdict="indistinguishable", twins=(one.hidden[0],))
    wrong = replace(one, **other, verdict="named", twins=())
    rows = {row.what: row.found for row in summary([one, together, wrong, one])}
    assert rows["first name and place right, D >= 6"].startswith("50.0%")
    same = next(what for what in rows if "named together" in what)
    assert rows[same].startswith("75.0%")
    assert rows["among the first three, D >= 5"].startswith("100.0%")


def test_names_that_are_wrong_are_counted_whatever_was_hidden(one):
    right = replace(one, verdict="named")
    cases = [
        right,
        replace(one, verdict="unknown"),
        replace(one, verdict="named", named="roll_off@floors"),
        replace(right, kind=OUTSIDE, hidden=("ground_tie@RF",), strength=30.0),
        replace(right, kind=OUTSIDE, hidden=("ground_tie@RF",), strength=30.0, verdict="none"),
        replace(right, kind=OUTSIDE, hidden=("ground_tie@RF",), strength=30.0, verdict="unknown"),
        replace(right, kind=OUTSIDE, hidden=("ground_tie@RF",), strength=3.0, verdict="none"),
    ]
    rows = {row.what: row.found for row in summary(cases)}
    assert rows["right among all names given"].startswith("33.3%")
    assert rows["verdict 'named' and the name right, D >= 6"].startswith("33.3%")
    assert rows["outside the catalogue, D >= 10: something is said to be left"].startswith("33.3%")


def test_the_result_is_written_with_machine_and_seed(run):
    content = run.report.content()
    assert content["seed"] == SEED
    assert sorted(one["kind"] for one in content["outcomes"]) == [CLEAN, ONE, ONE]
    assert "false alarms" in run.report.text


@pytest.mark.parametrize("data", [MODES, FORCE])
def test_trials_with_other_data_hide_what_these_show(tmp_path, four_stories, data):
    study = Study(tmp_path)
    models = trial_models(study, open_study(study, four_stories), SHORT, data=data)
    assert not any(models.shows(CATALOGUE[name]) for name in ("base_gain", "table_pitch"))
    assert models.shows(CATALOGUE["reversed_channel"]) == (data == MODES)
    outcome = run_trial(Trial(100_000 * SEED, CLEAN), models)
    assert outcome.verdict == "none"
    assert outcome.bias_before < 4.0


def test_trials_with_other_data_are_made_with_sticks(tmp_path, cabin_file):
    study = Study(tmp_path)
    model = open_study(study, "shear_4dof")
    frame = replace(model, building=load_building(str(cabin_file)))
    with pytest.raises(ReportError, match="modes data are made with sticks, and this is a frame"):
        trial_models(study, frame, TrialSettings(), data=MODES)


def test_a_mass_at_a_corner_is_that_of_the_floor():
    building = load_building(BUILDING)
    structure = fine_model(building, 1.0, building.sensors.points).structure
    effect = next(one for one in UNCATALOGUED if one.name == "corner_mass")
    values = effect.masses(structure, "RF")
    along = structure.points.axis == structure.direction
    whole = CATALOGUE["added_mass"].masses(structure, "RF")
    assert values[along].sum() == pytest.approx(whole[along].sum(), rel=1e-12)
    heavy = structure.points.position[values > 0.0]
    assert heavy[:, 0].max() <= 4.5
    assert heavy[:, 1].max() <= 3.0
