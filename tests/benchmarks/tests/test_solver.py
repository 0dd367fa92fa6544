"""The benchmark of the solver: what its tables say, and what it writes."""

import json
from pathlib import Path

import numpy as np
import pytest
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.solver import speed
from femupdate.benchmarks.solver.elements import element_scores, score_markdown
from femupdate.benchmarks.solver.run import solver_report
from femupdate.benchmarks.solver.score import ElementTest, Peer
from femupdate.benchmarks.solver.tower import tower

from femupdate.fe import assemble, lowest_modes


def score(value, peer=None, target=2.0):
    other = None if peer is None else Peer("other", peer)
    test = ElementTest("Test", "m", "source", "a reason")
    return test.score("case", "2x2", target, value, other)


@pytest.mark.parametrize(
    ("value", "peer", "verdict"),
    [
        (2.03, None, "within 2 %"),
        (1.95, None, "behind: a reason"),
        (1.80, 0.9, "best"),
        (2.20, 0.9, "best"),
        (1.77, 0.9, "within 2 % of best"),
        (1.75, 0.9, "behind: a reason"),
        (2.25, 0.9, "behind: a reason"),
    ],
)
def test_a_score_is_judged_by_the_best_peer_on_either_side(value, peer, verdict):
    assert score(value, peer).verdict == verdict


def test_a_target_of_zero_is_judged_by_the_value_itself():
    assert score(1e-9, target=0.0).reached
    assert not score(0.05, target=0.0).reached


def test_the_table_names_the_rows_that_are_behind_with_their_reason():
    text = score_markdown([score(2.0), score(1.5)])
    assert "1 of 2 rows" in text
    assert "* Test, case (2x2): a reason." in text


def test_every_published_test_scores_as_the_results_tell():
    path = Path(__file__).parents[3] / "docs" / "results" / "solver.json"
    kept = json.loads(path.read_text(encoding="utf-8"))["elements"]
    for found, row in zip(element_scores(), kept, strict=True):
        case = found.test, found.case, found.mesh
        assert case == (row["test"], row["case"], row["mesh"])
        assert found.value == pytest.approx(row["value"], rel=2e-3, abs=1e-9), case
        assert found.reached == row["reached"], case


def test_the_building_of_the_comparison():
    """Counts, and first and third frequencies beside the limit of MYSTRAN's meshes and ours."""
    building = tower(4)
    operators = assemble(building)
    assert (len(building.faces), len(building.lines)) == (1680, 1008)
    assert len(operators.free) == 10656
    found = lowest_modes(operators, np.ones(1), 3).frequency_hz
    assert found[[0, 2]] == pytest.approx([2.511, 3.612], rel=7e-3)


def test_results_are_written_with_machine_and_date(tmp_path):
    scores = (score(2.0), score(1.5))
    frequencies = np.arange(1.0, 21.0)
    costs = {"seconds": 3.0, "peak_memory_gb": 0.5, "steps": {}}
    run, other = (
        speed.Run(program=name, frequencies_hz=tuple(scale * frequencies), cpu_seconds=cpu, **costs)
        for name, scale, cpu in (("program", 1.0, 2.0), ("another", 1.01, 9.0))
    )
    counts = {"shells": 10, "beams": 20, "dof": 30}
    row = speed.SpeedRow(size="small", **counts, ours=run, theirs=other)
    report = solver_report(Job(tmp_path, 5), scores, (row,))
    found = report.content()
    assert found["seed"] == 5
    assert found["machine"]["packages"]["numpy"] == np.__version__
    assert found["speed"][0]["ratio"] == 4.5
    assert found["speed"][0]["largest_difference"] == pytest.approx(0.01)
    assert [one["reached"] for one in found["elements"]] == [True, False]
    assert "| another |" in report.text


def test_without_opensees_ours_runs_alone(monkeypatch):
    monkeypatch.setattr(speed, "opensees_is_there", lambda: False)
    monkeypatch.setattr(speed, "SIZES", {"tiny": 1})
    (row,) = speed.compare_speed(["tiny"])
    assert row.theirs is None
    assert row.ratio is None
    assert len(row.ours.frequencies_hz) == speed.MODES
    assert row.ours.cpu_seconds > 0.0
