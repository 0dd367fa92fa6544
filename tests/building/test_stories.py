"""Stories that stand beside each other: two towers on a podium, by hand and by OpenSees."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from femupdate.building import from_document, load_building, mesh_building
from femupdate.effects import CATALOGUE, structure_of
from femupdate.errors import BuildingError
from femupdate.fe import assemble, bulk_data, lowest_modes, opensees_script
from tests.documents import towers

THETA = np.array([0.8, 1.1, 1.3, 0.7, 0.6, 1.2])
STORIES = """\
stories = [
  { name = "P1", height = "4.5 m" },
  { name = "P2", height = "4 m" },
  { name = "A1", height = "3.2 m", x = ["0 m", "6 m"] },
  { name = "A2", height = "3.2 m", x = ["0 m", "6 m"] },
  { name = "B1", height = "3.2 m", x = ["12 m", "18 m"], on = "P2" },
  { name = "B2", height = "3.5 m", x = ["12 m", "18 m"] },
]
"""
BESIDE = """\
name = "towers"
kind = "mesh"
mesh = { file = "towers.bdf", unit = "m", force = "N" }
sensors = { direction = "x", points = [["0 m", "0 m"], ["18 m", "5 m"]] }
frequency_grid = { start = "0.1 Hz", step = "0.1 Hz", count = 100 }
prior.theta = { lower = 0.5, upper = 2 }
damping = { law = "constant", ratio = 0.02 }
"""


def test_two_towers_have_the_frequencies_of_opensees(opensees, tmp_path):
    model = mesh_building(from_document(towers())).model
    path = tmp_path / "model.py"
    path.write_text(opensees_script(model, THETA), encoding="utf-8")
    command = [sys.executable, str(path), "--json", "--modes", "6"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    theirs = json.loads(done.stdout.strip().splitlines()[-1])["frequencies_hz"]
    ours = lowest_modes(assemble(model), THETA, 6).frequency_hz
    np.testing.assert_allclose(theirs, ours, rtol=1e-3)


def test_a_brace_crosses_stories_that_stand_on_one_another():
    places = set(CATALOGUE["brace"].places(structure_of(from_document(towers()))))
    assert {"ground-2F", "2F-4F", "3F-6F", "2F-6F", "6F-RF"} <= places
    assert not places & {"4F-6F", "5F-6F", "5F-RF"}  # from tower to tower


def test_a_story_carries_what_stands_on_it():
    # The middle of every story is a node.
    structure = structure_of(from_document(towers(top=3.2)))
    column, beam = 2400.0 * 0.25, 2400.0 * 0.18  # kg/m
    tower = 2 * 22 * beam + 4 * 4.8 * column
    podium, whole = 56 * beam, 2 * tower + 8 * 1.6 * column
    second = whole + podium + 8 * 2.0 * column
    expected = [second + podium + 8 * (2.0 + 2.25) * column, second]
    expected += 2 * [tower, 22 * beam + 4 * 1.6 * column]
    np.testing.assert_allclose(structure.story_rigid[:, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(structure.feet, [0.0, 4.5, 8.5, 11.7, 8.5, 11.7])
    places = CATALOGUE["cracked_columns"].points(structure)
    assert "A1 to A2" in places
    assert "P2 to A1" in places
    assert not any(place.startswith("A") and "B" in place for place in places)


def test_what_turns_as_one_does_not_drift():
    """Wherever the sensors of its floors stand in plan."""
    made = towers()
    made["sensors"]["floors"] |= {"6F": ["C-1"], "5F": ["B-2"]}
    structure = structure_of(from_document(made))
    x, y, _ = structure.position.T
    turned = np.choose(structure.axis, [-y, x, 0.0 * x, 0.0 * x, 0.0 * x, np.ones_like(x)])
    # Only the podium's first story stands on what does not turn; its sensors are at y = 2.5 m.
    np.testing.assert_allclose(structure.drift_rows @ turned, [-2.5, 0, 0, 0, 0, 0], atol=1e-12)


def test_a_deck_has_the_stories_that_a_file_beside_it_gives(tmp_path):
    mesh = mesh_building(from_document(towers(slabs=True)))
    (tmp_path / "towers.bdf").write_text(bulk_data(mesh.model))
    path = tmp_path / "towers.toml"
    path.write_text(BESIDE + STORIES)
    read = mesh_building(load_building(path))
    for kind in ("column", "beam", "slab"):
        counts = [
            np.bincount(
                np.concatenate([b.group[b.kind == kind] for b in each.model.elements]), minlength=6
            )
            for each in (mesh, read)
        ]
        np.testing.assert_array_equal(*counts)
    ours, theirs = (lowest_modes(assemble(m.model), THETA, 6).frequency_hz for m in (mesh, read))
    np.testing.assert_allclose(theirs, ours, rtol=1e-6)
    assert "Floors: 2F over P1, 3F over P2, 4F over A1, 5F over A2, 6F over B1" in str(read.notes)
    assert read.model.nodes[read.floor_nodes["4F"]][:, 0].max() == 6.0
    assert read.model.nodes[read.floor_nodes["6F"]][:, 0].min() == 12.0
    assert any("A1 and B1 on 3F" in note for note in read.notes)


def test_springs_beside_a_deck_are_those_of_a_grid(tmp_path):
    springs = {"kx": 2e6, "kz": 4e8, "cx": 5e4}
    (tmp_path / "towers.bdf").write_text(bulk_data(mesh_building(from_document(towers())).model))
    path = tmp_path / "towers.toml"
    added = '[[springs]]\nkx = "2 MN/m"\nkz = "400 MN/m"\ncx = "50 kN s/m"\n'
    path.write_text(BESIDE + STORIES + added)
    read = structure_of(load_building(path))
    ours = structure_of(from_document(towers() | {"springs": [springs]}))
    np.testing.assert_allclose(
        *(lowest_modes(s.meshed[1], THETA, 6).frequency_hz for s in (read, ours)), rtol=1e-6
    )
    np.testing.assert_allclose(read.dashpots.max(axis=1), np.sqrt(5e4))


WRONG = {
    "a later story": ('on = "P2"', 'on = "B2"', "'B2' is no story listed before it; write"),
    "the wrong way": ('["12 m", "18 m"], on', '["18 m", "12 m"], on', "put the lower first"),
    "no such floor": ("points", 'floors."9F" = [["0 m", "0 m"]], points', "no floor is named '9F'"),
    "another's": ('x = ["12 m", "18 m"], on', "on", "have all nodes at 4F, 11.7 m; give them x"),
    "in none": ('x = ["0 m", "6 m"]', 'x = ["0 m", "3 m"]', "lie in none, such as at .*; widen"),
}


@pytest.mark.parametrize("case", WRONG)
def test_stories_that_do_not_fit_are_refused(case, tmp_path):
    old, new, message = WRONG[case]
    (tmp_path / "towers.bdf").write_text(bulk_data(mesh_building(from_document(towers())).model))
    path = tmp_path / "towers.toml"
    assert old in BESIDE + STORIES
    path.write_text((BESIDE + STORIES).replace(old, new))
    with pytest.raises(BuildingError, match=message) as caught:
        mesh_building(load_building(path))
    assert re.search("stories|sensors", str(caught.value))
