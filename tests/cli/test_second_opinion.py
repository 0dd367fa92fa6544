"""The commands that put another program beside ours."""

import ast
import json
from pathlib import Path

from femupdate.benchmarks.solver import run as solver
from femupdate.benchmarks.solver.score import ElementTest


def test_build_model_exports_a_script(femupdate, tmp_path, cabin_file):
    arguments = ("--export", "opensees", "--shell", "ShellMITC4", "--study", tmp_path, "--json")
    answer = femupdate("build-model", cabin_file, *arguments).answer
    assert answer["exported"] == [str(tmp_path / "opensees_model.py")]
    script = (tmp_path / "opensees_model.py").read_text(encoding="utf-8")
    ast.parse(script)
    assert "'shell': 'ShellMITC4'" in script


def test_a_shear_building_cannot_be_exported(femupdate, tmp_path, tower_file):
    done = femupdate("build-model", tower_file, "--export", "opensees", "--study", tmp_path)
    assert done.code == 1
    assert "no mesh to export" in done.err


def test_benchmark_solver(femupdate, tmp_path, monkeypatch):
    scores = tuple(
        ElementTest("Test", "m", "source").score("case", mesh, 1.0, value)
        for mesh, value in (("2x2", 1.2), ("4x4", 1.01))
    )
    monkeypatch.setattr(solver, "element_scores", lambda progress: scores)
    monkeypatch.setattr(solver, "draw_convergence", lambda scores, path: path)
    answer = femupdate("benchmark", "solver", "--sizes", "", "--output", tmp_path, "--json").answer
    assert answer["elements_reached"] == 1
    assert [one["verdict"] for one in answer["elements"]] == ["behind", "within 2 %"]
    assert json.loads((tmp_path / "solver.json").read_text(encoding="utf-8"))["speed"] == []
    done = femupdate("benchmark", "solver", "--sizes", "", "--output", tmp_path)
    assert "1 of 2 rows reach the best other" in done.out


def test_an_unknown_size_is_one_sentence(femupdate, tmp_path, monkeypatch):
    monkeypatch.setattr(solver, "element_scores", lambda progress: ())
    done = femupdate("benchmark", "solver", "--sizes", "huge", "--output", tmp_path)
    assert done.code == 1
    assert done.err.strip().splitlines()[-1].startswith("Error: there is no size 'huge'")


def test_benchmark_training(femupdate, tmp_path):
    arguments = ("--samples", "600", "--minutes", "0.005", "--output", tmp_path)
    answer = femupdate("benchmark", "training", *arguments, "--json").answer
    found = json.loads((tmp_path / "training.json").read_text(encoding="utf-8"))
    assert answer["loss"] == found["reached"]["loss"]
    assert answer["cpu_ratio"] == found["cpu_ratio"]
    assert answer["pictures"] == [str(tmp_path / "training.png")]
    done = femupdate("benchmark", "training", "--samples", "100", "--output", tmp_path)
    assert done.code == 1
    assert "100 samples are too few for batches of 512" in done.err


def test_benchmark_latent_size(femupdate, tmp_path):
    """Every story's stiffness counts, at the roof of four stories as well."""
    arguments = ("benchmark", "latent-size", "--draws", "30", "--output", tmp_path)
    answer = femupdate(*arguments, "--sensors", "RF", "--json").answer
    assert answer["enough"] == 4
    assert answer["nats"] == sorted(answer["nats"], reverse=True)
    text = Path(answer["results"][1]).read_text(encoding="utf-8")
    assert "Enough: 4 of 4." in text
    done = femupdate(*arguments, "--sensors", "9F")
    assert done.code == 1
    assert "shear_4dof has no floor 9F to observe; it has 2F, 3F, 4F, RF" in done.err
