"""A short version of the trials in which effects are hidden from the finder."""

import json
from dataclasses import replace

import pytest
from femupdate.benchmarks.hidden_effects.draw import CLEAN, ONE, OUTSIDE
from femupdate.benchmarks.hidden_effects.kinds import FORCE, MODES
from femupdate.benchmarks.hidden_effects.measurement import TrialSettings
from femupdate.benchmarks.hidden_effects.run import TrialPlan, run_hidden_effects
from femupdate.benchmarks.hidden_effects.summary import summary, summary_text
from femupdate.benchmarks.hidden_effects.trial import Trial, run_trial, trial_models
from femupdate.benchmarks.result import Job

from femupdate.building.files import load_building
from femupdate.effects.registry import CATALOGUE
from femupdate.errors import ReportError
from femupdate.study import Study
from femupdate.workflow.model import open_study

# Numbers that no published trial has used; every outcome is a function of them.
_NUMBERS = (9_000_001, 9_000_002, 9_000_003)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    study = Study(tmp_path_factory.mktemp("study"))
    models = trial_models(study, open_study(study, "shear_4dof"), TrialSettings())
    # What the catalogue lacks is searched for longest.
    plan = {CLEAN: _NUMBERS, ONE: _NUMBERS[:2], OUTSIDE: _NUMBERS[1:2]}
    return {
        kind: [run_trial(Trial(number, kind), models) for number in numbers]
        for kind, numbers in plan.items()
    }


def test_nothing_is_found_where_nothing_is_hidden(outcomes):
    assert [one.verdict for one in outcomes[CLEAN]] == ["none"] * len(_NUMBERS)


def test_what_is_hidden_and_visible_is_named_and_the_gap_closes(outcomes):
    seen = [one for one in outcomes[ONE] if one.strength >= 6.0]
    assert seen
    for one in seen:
        assert one.named == one.hidden[0]
        if one.verdict == "named":
            assert one.held_after < one.held_before


def test_what_the_catalogue_lacks_is_not_called_nothing(outcomes):
    strong = [one for one in outcomes[OUTSIDE] if one.strength >= 10.0]
    assert strong
    assert all(one.verdict != "none" for one in strong)


def test_the_summary_counts(outcomes):
    clean = outcomes[CLEAN]
    alarmed = [replace(clean[0], verdict="named"), *clean[1:]]
    rows = {row.what: row for row in summary(alarmed)}
    assert rows["false alarms on clean cases"].found.startswith("33.3%")
    assert rows["false alarms on clean cases"].of == 3


def test_effects_named_together_count_apart_from_the_first_name(outcomes):
    one = next(one for one in outcomes[ONE] if one.strength >= 6.0)
    other = {"named": "roll_off@floors", "ranking": ("roll_off@floors", one.hidden[0])}
    together = replace(one, **other, verdict="indistinguishable", twins=(one.hidden[0],))
    wrong = replace(one, **other, verdict="named", twins=())
    rows = {row.what: row.found for row in summary([one, together, wrong, one])}
    assert rows["first name and place right, D >= 6"].startswith("50.0%")
    same = next(what for what in rows if "named together" in what)
    assert rows[same].startswith("75.0%")
    assert rows["among the first three, D >= 5"].startswith("100.0%")


def test_names_that_are_wrong_are_counted_whatever_was_hidden(outcomes):
    one = next(one for one in outcomes[ONE] if one.strength >= 6.0)
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


def test_names_are_counted_by_strength(outcomes):
    one = next(one for one in outcomes[ONE] if one.strength >= 6.0)
    cases = [
        replace(one, strength=3.0, verdict="none", named="", ranking=()),
        replace(one, strength=12.0, absorbed=0.2),
        replace(one, strength=12.0, absorbed=0.2, named="roll_off@floors"),
        replace(one, strength=12.0, absorbed=1.0),  # theta itself
        replace(one, strength=400.0),
    ]
    text = summary_text("shear_4dof", TrialSettings(), cases, summary(cases))
    assert "| 0 to 5 | 1 | 0 | 0 | 0 |" in text
    assert "| 10 to 20 | 2 | 2 | 1 | 2 |" in text
    assert "| from 100 | 1 | 1 | 1 | 1 |" in text


def test_the_result_is_written_with_machine_and_seed(tmp_path):
    plan = TrialPlan(clean=1, one=1, two=0, outside=0)
    report = run_hidden_effects(Job(tmp_path, 7), "shear_4dof", plan)
    content = report.content()
    assert content["seed"] == 7
    assert [one["kind"] for one in content["outcomes"]] == [CLEAN, ONE]
    assert "false alarms" in report.markdown.read_text(encoding="utf-8")


@pytest.mark.parametrize("data", [MODES, FORCE])
def test_trials_with_other_data_hide_what_these_show(tmp_path, data):
    study = Study(tmp_path)
    models = trial_models(study, open_study(study, "shear_4dof"), TrialSettings(), data=data)
    assert not any(models.shows(CATALOGUE[name]) for name in ("base_gain", "table_pitch"))
    assert models.shows(CATALOGUE["reversed_channel"]) == (data == MODES)
    outcome = run_trial(Trial(_NUMBERS[0], CLEAN), models)
    assert outcome.verdict == "none"
    assert outcome.bias_before < 4.0


def test_trials_with_other_data_are_made_with_sticks(tmp_path, cabin_file):
    study = Study(tmp_path)
    model = open_study(study, "shear_4dof")
    frame = replace(model, building=load_building(str(cabin_file)))
    with pytest.raises(ReportError, match="modes data are made with sticks, and this is a frame"):
        trial_models(study, frame, TrialSettings(), data=MODES)


def test_trials_that_were_cut_off_go_on(tmp_path):
    plan, job = TrialPlan(clean=2, one=0, two=0, outside=0), Job(tmp_path, 7)
    none = run_hidden_effects(job, "shear_4dof", plan, minutes=0.0)
    assert not none.content()["outcomes"]
    whole = run_hidden_effects(job, "shear_4dof", plan).content()["outcomes"]
    log = tmp_path / "hidden_effects_shear_4dof.jsonl"
    lines = log.read_text(encoding="utf-8").splitlines()
    marked = json.loads(lines[1])
    marked["content"]["seconds"] = 123.0
    log.write_text("\n".join([lines[0], json.dumps(marked), lines[2][:40]]), encoding="utf-8")
    again = run_hidden_effects(job, "shear_4dof", plan).content()["outcomes"]
    assert [one["number"] for one in again] == [one["number"] for one in whole]
    assert sorted(one["seconds"] == 123.0 for one in again) == [False, True]
