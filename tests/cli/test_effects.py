"""simulate --effect, diagnose and repair as commands: their answers, and input that is wrong."""

import json

import pytest

TABLE = "frequency_hz,2F,RF"
KEYS = {
    "diagnose": {"p_value", "verdict", "effects", "where", "seconds"},
    "repair": {
        *("rounds", "chi2_before", "chi2_after", "holdout_error_before", "holdout_error_after"),
        *("building", "verdict"),
    },
}


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    return tmp_path_factory.mktemp("effects")


@pytest.fixture(scope="module")
def hidden(femupdate, tower_file, work):
    """Two runs of the tower with a damper in its upper story, and one without."""
    files = {}
    for name, seed, effects in (
        ("heavy", 1, ("--effect", "story_damper@RF=0.06")),
        ("kept", 2, ("--effect", "story_damper@RF=0.06")),
        ("plain", 3, ()),
    ):
        files[name] = work / f"{name}.csv"
        done = femupdate(
            *("simulate", "-o", files[name], "--building", tower_file, "--theta", "0.8,1.3"),
            *("--zeta", "0.05", "--duration", 60, "--sampling", 50, "--band", "0.3,20"),
            *("--seed", seed, *effects, "--json"),
        )
        told = done.answer["truth"]
        assert told["theta"] == [0.8, 1.3]
        assert bool(told.get("effects")) == bool(effects)
    return files


def test_the_truth_beside_the_file_tells_the_effect(hidden):
    truth = json.loads(hidden["heavy"].with_suffix(".truth.json").read_text())
    assert "story_damper@RF" in json.dumps(truth["effects"])
    assert "0.06" in json.dumps(truth["effects"])


@pytest.fixture(scope="module")
def repaired(femupdate, hidden, tower_file, work):
    """diagnose and repair in one study: their answers."""
    study = work / "study"
    first = femupdate(
        "diagnose", hidden["heavy"], "--building", tower_file, "--study", study, "--json"
    )
    second = femupdate(
        *("repair", hidden["heavy"], "--holdout", hidden["kept"], "--study", study, "--json")
    )
    return {"diagnose": first.answer, "repair": second.answer, "study": study}


@pytest.mark.parametrize("command", KEYS)
def test_the_answer_has_the_keys_that_scripts_rely_on(repaired, command):
    assert KEYS[command] <= set(repaired[command])
    for path in repaired[command]["pictures"]:
        assert path.endswith(".png")


def test_the_effect_is_named_added_and_helps(repaired):
    found, done = repaired["diagnose"], repaired["repair"]
    assert found["verdict"] == "named"
    assert (found["effects"][0]["name"], found["effects"][0]["place"]) == ("story_damper", "RF")
    assert done["verdict"] == "repaired"
    assert [one["effect"] for one in done["rounds"]] == ["story_damper"]
    assert done["rounds"][0]["size"] == pytest.approx(0.06, abs=0.006)
    assert done["chi2_after"] < 0.5 * done["chi2_before"]
    assert done["holdout_error_after"] < 0.5 * done["holdout_error_before"]
    assert done["building"] == str(repaired["study"] / "repaired" / "building.toml")


def test_from_which_change_on_an_effect_matters_is_the_user_s_choice(femupdate, repaired, hidden):
    study = repaired["study"]
    least = ("--least-frequency", "0.9", "--least-response", "0.9")
    found = femupdate("diagnose", hidden["heavy"], "--study", study, *least, "--json").answer
    assert found["verdict"] == "none"
    assert "of no consequence" in found["sentence"]
    done = femupdate("repair", hidden["heavy"], "--study", study, *least, "--json").answer
    assert (done["verdict"], done["rounds"]) == ("none", [])


def test_words_for_people(femupdate, repaired, hidden):
    """Without --json: the verdict first, a table, the pictures."""
    study = repaired["study"]
    told = femupdate("diagnose", hidden["heavy"], "--study", study, "--sampled", "1")
    assert told.code == 0
    assert told.out.startswith("Verdict: named. The story below RF adds ")
    (row, *_) = [line.split() for line in told.out.splitlines() if "story_damper@RF" in line]
    assert row[2] == "±"  # the error of the sampled evidence
    assert 0.0 < float(row[3]) < 1.0
    told = femupdate("repair", hidden["heavy"], "--study", repaired["study"])
    assert told.code == 0
    assert told.out.startswith("1. The story below RF adds ")
    assert "repaired building" in told.out


def test_the_repaired_study_answers_to_the_other_commands(femupdate, repaired, hidden, work):
    study = repaired["study"] / "repaired"
    record = work / "record.csv"
    rows = [f"{0.02 * n:.2f},{((n * 7919) % 100 - 50) / 50:.3f}" for n in range(300)]
    record.write_text("\n".join(["time_s,EW", "s,m/s2", *rows]) + "\n")
    told = femupdate("predict", "--study", study, "--record", record, "--json", "--samples", 20)
    assert set(told.answer["peak_acceleration_m_s2"]) == {"2F", "RF"}
    assert femupdate("render", "--study", study, "--json").code == 0
    told = femupdate(
        "calibrate", hidden["kept"], "--study", study, "--exact", "--particles", 200, "--json"
    )
    assert told.answer["parameters"][-1] == "story_damper@RF.size"
    refused = femupdate("calibrate", hidden["kept"], "--study", study)
    assert "story_damper at RF" in refused.complaint
    assert "--exact" in refused.complaint


def test_repair_refuses_when_nothing_is_missing(femupdate, hidden, tower_file, tmp_path):
    study = tmp_path / "study"
    told = femupdate("repair", hidden["plain"], "--building", tower_file, "--study", study)
    assert told.code == 0
    assert told.out.startswith("Nothing was added (none).")
    assert not (study / "repaired").exists()


def test_what_two_floors_cannot_tell_is_left_to_the_engineer(femupdate, tower_file, work):
    """Only the ratio of two masses shows: more on 2F is less on RF with softer stories."""
    file, study = work / "ratio.csv", work / "ratio"
    done = femupdate(
        *("simulate", "-o", file, "--building", tower_file, "--theta", "0.8,1.3"),
        *("--zeta", "0.05", "--duration", 60, "--sampling", 50, "--band", "0.3,20"),
        *("--effect", "added_mass@2F=0.2"),
    )
    assert done.code == 0
    told = femupdate("diagnose", file, "--building", tower_file, "--study", study, "--json").answer
    assert told["verdict"] == "indistinguishable"
    assert {one["name"] for one in told["effects"][:2]} == {"added_mass"}
    assert {one["place"] for one in told["effects"][:2]} == {"2F", "RF"}
    # 1.2 m_1 with m_2 is m_1 with m_2 / 1.2.
    sizes = {one["place"]: one["size"] for one in told["effects"][:2]}
    assert sizes["2F"] == pytest.approx(0.2, abs=0.03)
    assert sizes["RF"] == pytest.approx(1 / 1.2 - 1, abs=0.03)
    refused = femupdate("repair", file, "--study", study)
    assert refused.out.startswith(f"Nothing was added ({told['verdict']}).")
    assert not (study / "repaired").exists()


BAD = {
    "missing": (lambda w, h: w / "no.csv", "no such file"),
    "empty": (lambda w, h: _file(w, ""), "the file is empty"),
    "other building": (
        lambda w, h: _file(w, h["plain"].read_text().replace(",RF", ",9F", 1)),
        "another building",
    ),
    "no base": (
        lambda w, h: _file(w, h["plain"].read_text().replace("time_s,base", "time_s,3F", 1)),
        "base",
    ),
}


def _file(folder, text):
    path = folder / "bad.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize("command", ["diagnose", "repair"])
@pytest.mark.parametrize("case", BAD)
def test_an_observation_that_cannot_be_used(
    femupdate, hidden, repaired, snapshot, tmp_path, case, command
):
    make, words = BAD[case]
    before = snapshot(repaired["study"])
    done = femupdate(command, make(tmp_path, hidden), "--study", repaired["study"], "--json")
    assert words in done.complaint
    assert snapshot(repaired["study"]) == before


def test_held_out_data_that_cannot_be_used(femupdate, hidden, repaired, snapshot, tmp_path):
    before = snapshot(repaired["study"])
    done = femupdate(
        *("repair", hidden["heavy"], "--holdout", tmp_path / "no.csv"),
        *("--study", repaired["study"], "--json"),
    )
    assert "no such file" in done.complaint
    assert snapshot(repaired["study"]) == before


@pytest.mark.parametrize("command", ["diagnose", "repair"])
def test_another_building_than_the_study_has(femupdate, hidden, repaired, snapshot, command):
    before = snapshot(repaired["study"])
    done = femupdate(
        *(command, hidden["heavy"], "--study", repaired["study"]),
        *("--building", "shear_3dof", "--json"),
    )
    assert "holds the building tower" in done.complaint
    assert snapshot(repaired["study"]) == before


@pytest.mark.parametrize("command", ["diagnose", "repair"])
def test_a_building_file_with_an_impossible_effect(
    femupdate, hidden, tower_file, snapshot, tmp_path, command
):
    building = tmp_path / "wrong.toml"
    entry = '\n[[effects]]\nname = "added_mass"\nplace = "9F"\n'
    building.write_text(tower_file.read_text() + entry)
    done = femupdate(command, hidden["heavy"], "--building", building, "--study", tmp_path / "s")
    assert "effects[0].place" in done.complaint
    assert "'9F'" in done.complaint


WRONG_EFFECTS = {
    "unknown": ("ghost@2F=0.1", 1, "no effect is named 'ghost'"),
    "place": ("added_mass@9F=0.1", 1, "added_mass cannot sit at '9F'; it can at 2F, RF"),
    "too many": ("added_mass@2F=0.1,0.2", 1, "it takes size"),
    "beyond its limits": ("added_mass@2F=-2", 1, "from -0.5 to 1"),
    "no size": ("added_mass@2F", 1, "give its size, such as added_mass@2F=0.1"),
    "no place": ("added_mass=0.1", 2, "name@place=size"),
    "no number": ("added_mass@2F=much", 2, "name@place=size"),
    "not a number": ("added_mass@2F=nan", 1, "from -0.5 to 1"),
}


@pytest.mark.parametrize("case", WRONG_EFFECTS)
def test_an_effect_that_cannot_be_simulated(femupdate, tower_file, tmp_path, case):
    label, code, words = WRONG_EFFECTS[case]
    output = tmp_path / "o.csv"
    done = femupdate("simulate", "-o", output, "--building", tower_file, "--effect", label)
    assert done.code == code
    assert words in " ".join(done.err.split())
    assert "Traceback" not in done.err
    assert list(tmp_path.iterdir()) == []
