"""What `status` says of a study: current, stale, damaged, missing, interrupted, next."""

import json
import re

import pytest

from femupdate.errors import StudyError
from femupdate.study import Study, write_text
from femupdate.workflow import study_status


@pytest.fixture
def look(calibrated):
    """A function that says the state of each item, and the study."""
    study = Study(calibrated)
    return study, lambda: {item.name: item.state for item in study_status(study).holds}


def test_a_calibrated_study_is_current_and_a_prediction_comes_next(look):
    study, states = look
    assert states() == {"reduced model": "current", "posterior": "current"}
    report = study_status(study)
    assert report.building == "tower (Two-story tower)"
    assert report.next[0][0].startswith("femupdate predict --record RECORD --study ")
    kept = json.loads(study.path("posterior_summary.json").read_text(encoding="utf-8"))
    assert [one.removeprefix("Posterior: ") for one in report.warnings] == kept["warnings"]
    assert list(report.first) == kept["first"]


def test_another_building_makes_everything_stale(look):
    study, states = look
    path = study.path("building.toml")
    text = path.read_text(encoding="utf-8")
    write_text(path, text.replace("3 t", "3.5 t").replace("3000 kg", "3500 kg"))
    assert set(states().values()) == {"stale"}
    posterior = study_status(study).holds[-1]
    assert posterior.reason == "the building changed since"


def test_an_edited_measurement_makes_its_posterior_stale(look, tmp_path):
    study, states = look
    entries = json.loads(study.path("study.json").read_text(encoding="utf-8"))
    copy = tmp_path / "my run.csv"
    copy.write_text("edited", encoding="utf-8")
    entries["artefacts"]["posterior"]["settings"]["file"] = str(copy)
    write_text(study.path("study.json"), json.dumps(entries))
    assert states()["posterior"] == "stale"
    report = study_status(study)
    assert report.holds[-1].reason == "the file my run.csv changed since"
    assert report.next[0][0].startswith(f"femupdate calibrate '{copy}' --study")


@pytest.mark.parametrize(
    ("words", "again"),
    [
        (
            ["build-model", "--export", "opensees"],
            ("build-model --export opensees", "calibrate {}"),
        ),
        (["calibrate", "a b.csv", "--unit", "g"], ("build-model", "calibrate 'a b.csv' --unit g")),
        (["demo"], ("build-model", "demo")),
        (["calibrate", "$(id); rm x"], ("build-model", "calibrate '$(id); rm x'")),
    ],
)
def test_a_command_is_told_as_it_was_called(look, tower_observation, words, again):
    """A model is made on the way by many commands; it alone needs no more than its own."""
    study, _ = look
    entries = json.loads(study.path("study.json").read_text(encoding="utf-8"))
    for name, artefact in entries["artefacts"].items():
        if words[0] != "build-model" or name == "reduced model":
            artefact["settings"]["words"] = words
    write_text(study.path("study.json"), json.dumps(entries))
    found = {item.name: item.again for item in study_status(study).holds}
    model, posterior = again
    assert found["reduced model"] == model
    # What tests share is made by one process of theirs, from an observation in a folder of its own.
    again = re.sub(r"/\S*/tower_observation\.csv", str(tower_observation.path), found["posterior"])
    assert again == posterior.format(tower_observation.path)


def test_a_new_posterior_makes_the_prediction_stale(look):
    study, states = look
    write_text(study.path("prediction.nc"), "bands")
    study.record(
        "prediction", "prediction.nc", "predict", {"posterior": "older"}, {"file": "r.at2"}
    )
    assert states()["prediction"] == "stale"
    command, reason = study_status(study).next[0]
    assert command.startswith("femupdate predict --record r.at2")
    assert reason == "The prediction is stale. The posterior changed since."


def test_a_page_is_asked_for_until_it_is_written(look):
    study, _ = look
    write_text(study.path("prediction.nc"), "")
    study.record("prediction", "prediction.nc", "predict", {})
    write_text(study.path("posterior_summary.json"), "{}")
    assert study_status(study).next[0][0].startswith("femupdate report")
    write_text(study.path("report.html"), "")
    report = study_status(study)
    assert (report.next, list(report.lines())[-1]) == (
        (),
        "Everything is current, and the page is written.",
    )


def test_inner_studies_are_named(look):
    study, _ = look
    inner = Study(study.path("repaired"))
    write_text(inner.path("note"), "any")
    inner.record("note", "note", "repair", {})
    report = study_status(study)
    assert report.studies == (inner.folder,)
    # What was repaired predicts, not what was found wrong.
    assert f"--study {inner.folder}" in report.next[0][0]


def test_a_named_effect_asks_for_a_repair(look):
    study, _ = look
    for verdict, command in {"named": "repair 'run 1.csv'", "none": "predict"}.items():
        write_text(study.path("diagnosis.json"), f'{{"verdict": "{verdict}", "sentence": "So."}}')
        study.record("diagnosis", "diagnosis.json", "diagnose", {}, {"file": "run 1.csv"})
        found = study_status(study)
        assert found.next[0][0].startswith(f"femupdate {command}")
        said = f"What the model lacks by run 1.csv: {verdict}. So."  # as on the page
        assert found.first[-1] == said
    nothing = {"rounds": [], "verdict": "unknown", "sentence": "Nothing is certain."}
    for number, command in {2: "repair 'run 1.csv'", 1: "predict"}.items():
        write_text(study.path("diagnosis.json"), '{"verdict": "named", "sentence": "So."}')
        study.record("diagnosis", "diagnosis.json", "diagnose", {}, {"file": "run 1.csv"})
        write_text(study.path("repair.json"), json.dumps(nothing))
        study.record("repair", "repair.json", "repair", {}, {"file": f"run {number}.csv"})
        found = study_status(study)
        assert found.next[0][0].startswith(f"femupdate {command}")  # never what was tried
        assert f"by run {number}.csv added nothing (unknown)" in found.first[-1]


def test_a_repair_is_told_and_asked_for_where_it_was_not_made(look):
    study, _ = look
    inner = Study(study.path("repaired"))
    asked = f"femupdate repair FILE --study {study.folder}"
    assert study_status(inner).next[0][0] == asked
    with pytest.raises(StudyError, match="repair FILE"):
        inner.require("posterior", "calibrate")
    repair = {"rounds": [{"in_words": "Added mass at RF"}], "chi2_before": 90.0, "chi2_after": 7.0}
    write_text(study.path("repair.json"), json.dumps({**repair, "independent_points": 8}))
    told = "Added mass at RF. Residuals of data fell from 90 to 7 over 8 independent points."
    for each, which in {study: "A repaired model has", inner: "This model was repaired"}.items():
        assert which in (last := study_status(each).first[-1])
        assert last.endswith(told)


def test_without_a_posterior_the_way_to_one_is_shown(tmp_path, tower_file):
    from femupdate.workflow import open_study

    study = Study(tmp_path)
    open_study(study, str(tower_file))
    ((command, _),) = study_status(study).next
    assert command.startswith("femupdate calibrate OBSERVATION")
