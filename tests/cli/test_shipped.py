"""list and examples: what comes with femupdate."""

import pytest

from femupdate.building import load_building, shipped_buildings
from femupdate.effects import CATALOGUE
from femupdate.measurement import read_observation_file
from femupdate.measurement.reader import readers
from tests.cli.commands import femupdate
from tests.helpers import snapshot


def test_everything_shipped_is_listed():
    answer = femupdate("list", "--json").answer
    assert [one["name"] for one in answer["buildings"]] == list(shipped_buildings())
    assert {one["name"] for one in answer["effects"]} == set(CATALOGUE)
    assert [one["name"] for one in answer["formats"]] == list(readers())
    stick = next(one for one in answer["buildings"] if one["name"] == "shear_4dof")
    assert (stick["kind"], stick["stories"]) == ("shear", 4)
    listed = {one["name"]: one for one in answer["effects"]}
    assert all(one["places"] and one["explains"] for one in listed.values())
    delay = listed["channel_delay"]
    assert delay["places"] == "Every floor"
    assert [(p["name"], p["unit"]) for p in delay["parameters"]] == [("size", "s")]
    assert listed["swapped_channels"]["parameters"] == []


def test_examples_are_copied_and_nothing_is_replaced(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    own = folder / "six_story_white_noise.csv"
    own.write_text("measured with care")
    answer = femupdate("examples", folder, "--json").answer
    assert answer["kept"] == [str(own)]
    assert own.read_text() == "measured with care"
    assert str(folder / "records" / "ridgecrest_2019_clc_90.csv") in answer["copied"]
    assert load_building(folder / "models" / "shear_4dof.toml").kind == "shear"
    assert not (folder / "__init__.py").exists()
    before = snapshot(folder)
    assert "stays as it is" in femupdate("examples", folder).out
    assert snapshot(folder) == before


def test_the_measured_example_comes_with_its_building_and_its_licence(tmp_path):
    femupdate("examples", tmp_path)
    hotel = tmp_path / "hotel"
    assert "MIT licence" in (hotel / "README.md").read_text()
    building = load_building(str(hotel / "hotel.toml"))
    for number, peak in ((3, 0.50), (7, 0.17)):  # m/s2; 50 and 17 gal are published
        seen = read_observation_file(hotel / f"quake_{number}.csv")
        assert set(seen.floors) == {"3F", "RF"} <= set(building.floors)
        base = seen.acceleration[[c.floor for c in seen.channels].index("base")]
        assert abs(base).max() == pytest.approx(peak, rel=0.05)
