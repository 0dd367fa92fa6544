"""The commands of benchmarks: what they print and write, and what they refuse."""

import json

import pytest
from click.testing import CliRunner
from femupdate.benchmarks.changes import run as changes
from femupdate.benchmarks.solver import run as solver
from femupdate.benchmarks.solver.score import ElementTest
from femupdate.cli.main import group

from femupdate.building.files import load_building
from femupdate.simulation.simulate import parse_effect


@pytest.fixture
def run(tmp_path):
    """Run a benchmark with its results in `tmp_path`; an unhandled exception fails the test."""

    def call(*arguments):
        words = ["benchmark", *arguments, "--output", str(tmp_path)]
        return CliRunner().invoke(group, words, catch_exceptions=False)

    return call


def answer(done):
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


def test_solver(run, tmp_path, monkeypatch):
    scores = tuple(
        ElementTest("Test", "m", "source").score("case", mesh, 1.0, value)
        for mesh, value in (("2x2", 1.2), ("4x4", 1.01))
    )
    monkeypatch.setattr(solver, "element_scores", lambda progress: scores)
    monkeypatch.setattr(solver, "draw_convergence", lambda scores, path: path)
    found = answer(run("solver", "--sizes", "", "--json"))
    assert found["elements_reached"] == 1
    assert [one["verdict"] for one in found["elements"]] == ["behind", "within 2 %"]
    assert found["results"] == [str(tmp_path / "solver.json")]
    assert found["pictures"] == [str(tmp_path / "convergence.png")]
    assert json.loads((tmp_path / "solver.json").read_text(encoding="utf-8"))["speed"] == []
    done = run("solver", "--sizes", "")
    assert "1 of 2 rows reach the best other" in done.stdout
    assert str(tmp_path / "solver.json") in done.stdout


def test_an_unknown_size_is_one_sentence(run, monkeypatch):
    monkeypatch.setattr(solver, "element_scores", lambda progress: ())
    done = run("solver", "--sizes", "huge")
    assert done.exit_code == 1
    assert done.stderr.strip().splitlines()[-1].startswith("Error: there is no size 'huge'")


def test_changes(run, tmp_path, monkeypatch):
    """A building: a softened story is named, no other, and nothing where nothing changed.

    Of what the other models lack it is only seen that it can be hidden: a pair takes 14 s.
    """
    for effects in changes._MODELS.values():
        for name, values in effects:
            assert parse_effect(load_building(changes.BUILDING), name, values)[1] == values
    monkeypatch.setattr(changes, "_MODELS", {"right": ()})
    found = answer(run("changes", "--pairs", "1", "--json"))
    assert found["right: unchanged"] == {"pairs": 1, "right": 1, "false_alarms": 0, "unclear": 0}
    assert found["right: softened"]["right"] == 1
    pairs = json.loads((tmp_path / "changes.json").read_text(encoding="utf-8"))["pairs"]
    assert [one["state"] for one in pairs] == ["unchanged", "softened"]
