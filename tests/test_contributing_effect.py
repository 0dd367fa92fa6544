"""The effect of CONTRIBUTING.md, put into the catalogue, is simulated, found, reduced and drawn."""

import sys

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.discrepancy.diagnose import diagnose
from femupdate.effects import CATALOGUE, DrawnBuilding, Effect, catalogue, structure_of
from femupdate.errors import BuildingError
from femupdate.measurement import observation_for
from femupdate.registry import classes_in
from femupdate.report import drawn
from femupdate.simulation import SimulationSettings, simulate_observation
from tests.discrepancy.posed import pose
from tests.helpers import contribute

STICK, SIZE = "shear_3dof", 0.15
HIDDEN = SimulationSettings(effects=(("neighbour@RF", (SIZE,)),), seed=4)


@pytest.fixture
def effect(tmp_path, monkeypatch):
    """The page's effect as a module beside the others."""
    contribute("A new effect", catalogue, "neighbour", tmp_path, monkeypatch)
    for kind in classes_in(catalogue, Effect):
        monkeypatch.setitem(CATALOGUE, kind.name, kind())
    yield CATALOGUE["neighbour"]
    sys.modules.pop(f"{catalogue.__name__}.neighbour", None)


def test_it_is_named_with_its_place_and_size(effect):
    building = load_building(STICK)
    histories = simulate_observation(building, HIDDEN).histories
    grid = building.frequency_grid.frequencies_hz()
    problem = pose(building, observation_for(building.floors, histories, grid))
    among = [f"{name}@{floor}" for name in ("neighbour", "added_mass") for floor in ("3F", "RF")]
    found = diagnose(problem, among=frozenset([*among, "story_damper@RF", "brace@ground-RF"]))
    assert {"neighbour@3F", "neighbour@RF"} <= {one.placed.label for one in found.scores}
    assert (found.verdict, found.leading.placed.label) == ("named", "neighbour@RF")
    assert abs(found.leading.size - SIZE) < 3.0 * found.leading.size_sd
    assert found.leading.size_sd < 0.3 * SIZE
    said = effect.said("RF", 0.15)
    assert said == "A neighbour at RF has 15 % of the building's stiffness"


def test_without_it_its_name_is_refused():
    with pytest.raises(BuildingError, match="no effect is named 'neighbour'"):
        simulate_observation(load_building(STICK), HIDDEN)


def test_it_is_drawn_beside_its_floor(effect):
    building = DrawnBuilding(structure_of(load_building(STICK)))
    for place, level in (("3F", 2), ("RF", 3)):
        points = np.concatenate(drawn(effect.glyphs(building, place)).lines)
        assert points[:, 2].mean() == pytest.approx(building.levels[level], abs=0.05)
        assert points[:, 0].max() == pytest.approx(building.low[0])
