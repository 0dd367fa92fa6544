"""The benchmark of the solver: what its tables say, and what it writes."""

import json
from pathlib import Path

import numpy as np
import pytest
from femupdate.benchmarks.solver.elements import element_scores
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
