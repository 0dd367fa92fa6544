"""What the commands answer: the keys that scripts rely on, and the tables that people read."""

import ast
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from femupdate import __version__
from tests.cli.commands import femupdate

BUILD = {"frequencies_hz", "dof", "elements", "reduced_size", "reduction_error", "study"}


def not_blank(path):
    """A picture of some size with more than one colour in it."""
    from matplotlib.image import imread

    pixels = imread(path)[..., :3]
    return min(pixels.shape[:2]) > 200 and pixels.std() > 0.01


@pytest.mark.parametrize("name", ["shear_3dof", "shear_4dof", "cabin"])
def test_build_model(tmp_path, cabin_file, name):
    study = tmp_path / "study"
    done = femupdate(
        "build-model", cabin_file if name == "cabin" else name, "--study", study, "--json"
    )
    answer = done.answer
    assert set(answer) >= BUILD
    assert answer["building"] == name
    assert answer["study"] == str(study)
    assert answer["frequencies_hz"] == sorted(answer["frequencies_hz"])
    assert answer["frequencies_hz"][0] > 0.1
    assert len(answer["effective_mass"]) == len(answer["frequencies_hz"])
    # In the cabin members have two elements, 4 columns and 4 beams a story; slabs and the wall in
    # the lower story are divided into 2 by 2.
    elements = {"shear_3dof": 3, "shear_4dof": 4, "cabin": 2 * (4 + 4) * 2 + 2 * 4 + 4}
    assert answer["elements"] == elements[name]
    assert 0 < answer["reduced_size"] <= answer["dof"]
    assert answer["reduction_error"] <= (0.1 if name == "cabin" else 0.0)
    assert len(answer["pictures"]) == (3 if name == "cabin" else 1)
    assert all(not_blank(Path(picture)) for picture in answer["pictures"])
    assert done.err.startswith("Building ")


def test_build_model_exports_a_script(tmp_path, cabin_file):
    arguments = ("--export", "opensees", "--study", tmp_path, "--json")
    answer = femupdate("build-model", cabin_file, *arguments).answer
    assert answer["exported"] == [str(tmp_path / "opensees_model.py")]
    ast.parse((tmp_path / "opensees_model.py").read_text(encoding="utf-8"))


def test_simulate(tmp_path, tower_file):
    file = tmp_path / "new" / "observation.csv"
    answer = femupdate(
        *("simulate", "-o", file, "--building", tower_file, "--theta", "0.7,1.2", "--zeta", "0.03"),
        *("--duration", 20, "--sampling", 50, "--band", "0.5,20", "--seed", 5, "--json"),
    ).answer
    assert answer["observation"] == str(file)
    assert answer["truth"]["theta"] == [0.7, 1.2]
    truth = json.loads(Path(answer["truth_file"]).read_text())
    assert truth["zeta"] == 0.03
    assert "synthetic" in file.read_text().splitlines()[0]


def test_simulate_replaces_a_file_only_when_it_is_told_to(tmp_path, tower_file):
    file = tmp_path / "observation.csv"
    file.write_text("measured with care")
    arguments = ("simulate", "-o", file, "--building", tower_file, "--duration", 10)
    refused = femupdate(*arguments, "--band", "0.5,20").complaint
    assert refused == f"{file} is there already; choose another name, or add --overwrite"
    assert file.read_text() == "measured with care"
    assert femupdate(*arguments, "--band", "0.5,20", "--overwrite").code == 0
    assert "synthetic" in file.read_text()


def test_simulate_takes_the_building_of_the_study(calibrated, tmp_path):
    file = tmp_path / "observation.csv"
    words = ("simulate", "-o", file, "--study", calibrated, "--duration", 10, "--sampling", 50)
    done = femupdate(*words, "--band", "0.5,20")
    assert done.code == 0
    assert done.err.splitlines()[0].startswith("Building tower")
    quiet = femupdate(*words, "--band", "0.5,20", "--overwrite", "--quiet")
    assert (quiet.out, quiet.err) == (done.out, "")
    assert done.out.splitlines()[0] == str(file)
    assert "time_s,base,2F,RF" in file.read_text()


def test_a_calibration_without_a_surrogate_says_three_things_first(
    tower_file, tower_observation, tmp_path
):
    """It samples the data themselves, in place of stopping, and says so where more is asked for."""
    words = ("calibrate", tower_observation.path, "--building", tower_file, "--study", tmp_path)
    words = (*words, "--particles", 200, "--no-pictures")
    short, long = femupdate(*words), femupdate(*words, "-v")
    assert short.code == 0, short.err
    first = short.out.splitlines()
    assert first[0].startswith("Verdict: the data are explained (tower, 2F, RF of ")
    told = " ".join(line.strip() for line in first)
    interval = r"[\d.]+ to [\d.]+"
    lines = r".*\. Intervals \(90 %; masses, gains and clocks taken as exact\): "
    lines += rf"story low {interval}, story high {interval}, "
    lines += rf"damping ratio {interval}\. Next: `femupdate predict --record RECORD --study .*"
    assert re.fullmatch(lines, told)
    assert f" --study {tmp_path}`, or" in told
    assert "No surrogate is trained" in short.err
    seen = femupdate("status", "--study", tmp_path).out.splitlines()
    assert seen[1] == first[0]
    for jargon in ("effective sample size", "p-value", "No surrogate of tower is trained"):
        assert jargon not in short.out
        assert jargon in long.out
    assert not any(word in short.out for word in ("MVAE", "validation loss", "Gaussians", "power"))
    for word in ("damping ratio", "Welch H1", str(tmp_path / "posterior.nc")):
        assert word in long.out


def test_calibrate(walk, tower_observation):
    answer, study = walk.answers["calibrate"], walk.study
    assert answer["posterior"] == str(study / "posterior.nc")
    assert answer["likelihood"] == "exact"
    assert answer["parameters"] == ["theta_1", "theta_2"]
    assert answer["particles"] == 200
    assert answer["floors"] == ["2F", "RF"]
    assert np.isfinite(answer["log_evidence"])
    for low, mean, high in zip(answer["q05"], answer["mean"], answer["q95"], strict=True):
        assert low < mean < high
    # Within 2 %: twenty posterior standard deviations, and a tenth of what tells the stories apart.
    assert answer["mean"] == pytest.approx(tower_observation.theta, rel=0.02)
    assert all(not_blank(Path(picture)) for picture in answer["pictures"])
    identified = answer["identifiability"]
    assert identified["undetermined"] == 0
    assert len(identified["modes"]) == 1
    assert set(identified["combinations"][0]["weight"]) == {"theta_1", "theta_2"}
    summary = json.loads((study / "posterior_summary.json").read_text())
    assert summary["identifiability"] == identified
    p_values = answer["posterior_predictive_p"]
    assert summary["posterior_predictive_p"] == p_values
    assert list(p_values["floors"]) == ["2F", "RF"]
    assert 0.0 < p_values["whole"] <= 1.0
    assert [p["mean"] for p in summary["parameters"]] == pytest.approx(answer["mean"])


def test_train(walk):
    answer = walk.answers["train"]
    assert answer["surrogate"] == str(walk.study / "surrogate.safetensors")
    assert answer["trained"] is True
    assert Path(answer["surrogate"]).stat().st_size > 10_000


def test_calibrate_with_the_surrogate(walk):
    answer = walk.answers["calibrate --name=latent"]
    assert answer["likelihood"] == "latent"
    assert "log_evidence" not in answer
    assert any("error of the model" in note for note in answer["notes"])
    assert answer["pictures"] == []
    assert not (walk.study / "posteriors" / "latent" / "pictures").exists()


def test_predict(walk):
    answer = walk.answers["predict"]
    assert answer["prediction"] == str(walk.study / "prediction.nc")
    assert answer["floors"] == ["2F", "RF"]
    assert list(answer["peak_acceleration_m_s2"]) == ["2F", "RF"]
    assert list(answer["story_stiffness_n_per_m"]) == ["1", "2"]
    for statistics in (
        *answer["peak_acceleration_m_s2"].values(),
        *answer["story_stiffness_n_per_m"].values(),
    ):
        assert 0 < statistics["q05"] <= statistics["mean"] <= statistics["q95"]
    for floor in ("2F", "RF"):
        # The measurement has 0.003 m/s2 of noise, a hundredth of the motion.
        assert answer["comparison"][floor]["relative_error"] < 0.05
        assert answer["comparison"][floor]["correlation"] > 0.99
    assert all(not_blank(Path(picture)) for picture in answer["pictures"])


def test_render(walk, walked):
    modes = walk.answers["render"]["modes"]
    assert sorted(mode["mode"] for mode in modes) == [1, 2]
    assert all(not_blank(Path(mode["picture"])) for mode in modes)
    assert all(mode["found"] == 1.0 for mode in modes)
    text = femupdate("render", "--study", walked, "--modes", 1).out
    assert "recognised in draws" in text
    assert text.count("modes.png") == 1


def test_every_artefact_of_a_study_is_recorded_with_what_it_was_made_from(walk):
    kept = json.loads((walk.study / "study.json").read_text())["artefacts"]
    assert {"reduced model", "posterior", "prediction", "surrogate", "diagnosis"} <= set(kept)
    for artefact in kept.values():
        assert artefact["version"] == __version__
        assert (walk.study / artefact["file"]).exists()
        assert artefact["made_from"]["building"] == kept["reduced model"]["made_from"]["building"]
    assert kept["prediction"]["made_from"]["posterior"] == kept["posterior"]["sha256"]


RECORDED = Path(__file__).with_name("contract.json")


def key_paths(content, path=""):
    """Every key of a JSON object with the keys above it; elements of a list are taken together."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield f"{path}.{key}".lstrip(".")
            yield from key_paths(value, f"{path}.{key}")
    elif isinstance(content, list):
        for value in content:
            yield from key_paths(value, f"{path}[]")


def layout(study):
    """Files of a study, with the headings of its tables."""
    for path in sorted(study.rglob("*")):
        if path.is_file() and not path.name.startswith("."):
            yield str(path.relative_to(study))
            if path.suffix == ".csv" and path.parent.name == "tables":
                yield f"{path.name}: {path.read_text(encoding='utf-8-sig').splitlines()[0]}"


def test_nothing_that_users_rely_on_has_vanished(walk):
    now = {command: sorted(set(key_paths(answer))) for command, answer in walk.answers.items()}
    now["study"] = list(layout(walk.study))
    if os.environ.get("FEMUPDATE_RECORD"):
        RECORDED.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))
    missing = {
        name: gone
        for name, entries in recorded.items()
        if (gone := [entry for entry in entries if entry not in now[name]])
    }
    assert not missing
