"""What is shipped, and the archive of a station from file to prediction."""

import shlex
import zipfile

import numpy as np
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


PLACES = {"base": "Basement", "2F": "2nd floor, north wall", "RF": "Roof"}


def esm(values, time_step, place):
    head = {
        "EVENT_NAME": "SIMULATED",
        "STATION_NAME": place,
        "SAMPLING_INTERVAL_S": f"{time_step:.6f}",
        "NDATA": len(values),
        "UNITS": "cm/s^2",
        "STREAM": "HNE",
    }
    lines = [*(f"{key}: {value}" for key, value in head.items()), *(f"{v:.6f}" for v in values)]
    return "\n".join(lines) + "\n"


@pytest.fixture
def archive(tmp_path, tower_observation):
    data = read_observation_file(tower_observation.path)
    path = tmp_path / "station.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for number, (channel, row) in enumerate(zip(data.channels, data.acceleration, strict=True)):
            text = esm(100.0 * row, data.time_step, PLACES[channel.floor])
            packed.writestr(f"{number}.asc", text)
    return path


def test_inspect_proposes_the_command_that_calibrates(
    archive, tower_file, tower_observation, tmp_path
):
    (one,) = femupdate("inspect", archive, "--json").answer["files"]
    assert one["next"] == f"femupdate calibrate {archive} --columns base=1,2F=2,RF=3"
    options = ("--building", tower_file, "--exact", "--particles", 200, "--chains", 1, "--json")
    answers = [
        femupdate(*words, *options, "--study", tmp_path / f"study {number}").answer
        for number, words in enumerate(
            [shlex.split(one["next"])[1:], ["calibrate", tower_observation.path]]
        )
    ]
    assert answers[0]["floors"] == ["2F", "RF"]
    # The same numbers but for their printed digits.
    np.testing.assert_allclose(answers[0]["mean"], answers[1]["mean"], rtol=1e-3)
