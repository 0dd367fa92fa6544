"""simulate --effect, diagnose and repair as commands: their answers, and input that is wrong."""

import json

import pytest

from tests.cli.commands import femupdate


def test_the_truth_beside_the_file_tells_the_effect(walk):
    truth = json.loads(walk.heavy.with_suffix(".truth.json").read_text())
    assert truth["effects"] == walk.answers["simulate"]["truth"]["effects"]
    assert truth["theta"] == [0.8, 1.3]
    (effect,) = truth["effects"]
    assert effect["effect"] == "story_damper@RF"
    assert "0.06" in json.dumps(effect)


def test_the_effect_is_named_added_and_helps(walk):
    found, done = walk.answers["diagnose"], walk.answers["repair"]
    assert found["verdict"] == "named"
    assert (found["effects"][0]["name"], found["effects"][0]["place"]) == ("story_damper", "RF")
    assert done["verdict"] == "repaired"
    assert [one["effect"] for one in done["rounds"]] == ["story_damper"]
    assert done["rounds"][0]["size"] == pytest.approx(0.06, abs=0.006)
    assert done["chi2_after"] < 0.5 * done["chi2_before"]
    assert done["holdout_error_after"] < 0.5 * done["holdout_error_before"]
    assert done["building"] == str(walk.study / "repaired" / "building.toml")
    assert all(path.endswith(".png") for path in found["pictures"] + done["pictures"])


def test_from_which_change_on_an_effect_matters_is_the_user_s_choice(walk, walked):
    study = walked
    least = ("--least-frequency", "0.9", "--least-response", "0.9")
    found = femupdate("diagnose", walk.heavy, "--study", study, *least, "--json").answer
    assert found["verdict"] == "none"
    assert "of no consequence" in found["sentence"]


def test_the_repaired_study_answers_to_the_other_commands(walk, walked, record):
    study = walked / "repaired"
    told = femupdate("predict", "--study", study, "--record", record, "--json", "--samples", 20)
    assert set(told.answer["peak_acceleration_m_s2"]) == {"2F", "RF"}
    assert femupdate("render", "--study", study, "--json").code == 0
    told = femupdate(
        "calibrate", walk.kept, "--study", study, "--exact", "--particles", 200, "--json"
    )
    assert told.answer["parameters"][-1] == "story_damper@RF.size"


WRONG_EFFECTS = {
    "unknown": ("ghost@2F=0.1", "no effect is named 'ghost'"),
    "place": ("added_mass@9F=0.1", "added_mass cannot sit at '9F'; it can at 2F, RF"),
    "too many": ("added_mass@2F=0.1,0.2", "it takes size"),
    "beyond its limits": ("added_mass@2F=-2", "from -0.5 to 1"),
    "no size": ("added_mass@2F", "give its size, such as added_mass@2F=0.1"),
    "no place": ("added_mass=0.1", "name@place=size"),
    "no number": ("added_mass@2F=much", "name@place=size"),
    "not a number": ("added_mass@2F=nan", "from -0.5 to 1"),
}


@pytest.mark.parametrize("case", WRONG_EFFECTS)
def test_an_effect_that_cannot_be_simulated(tower_file, tmp_path, case):
    label, words = WRONG_EFFECTS[case]
    output = tmp_path / "o.csv"
    done = femupdate("simulate", "-o", output, "--building", tower_file, "--effect", label)
    assert done.code == 1
    assert words in " ".join(done.err.split())
    assert "Traceback" not in done.err
    assert list(tmp_path.iterdir()) == []
