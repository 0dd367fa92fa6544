"""The shipped buildings that show the entries of a building file stand and weigh what they say."""

import numpy as np
import pytest

from femupdate.building import load_building, mesh_building, shipped_buildings
from femupdate.fe import assemble, lowest_modes


@pytest.mark.parametrize(
    ("name", "tonnes", "linked_beams", "band"),
    # Two floors of a coupling beam with two ends; twelve of two beams.
    [("two_story_openings", 130.0, 4, (1.0, 4.0)), ("twelve_story_core", 12 * 420.0, 48, (0.5, 2))],
)
def test_example_building(name, tonnes, linked_beams, band):
    mesh = mesh_building(load_building(name))
    operators = assemble(mesh.model)
    motion = operators.rigid_translation(0)
    assert motion @ operators.mass_full @ motion == pytest.approx(tonnes * 1e3, rel=1e-9)
    joints = np.unique(mesh.model.links.master[mesh.model.links.tied[:, 3]])
    joints = np.setdiff1d(joints, len(mesh.model.nodes) - 1)
    assert len(joints) == linked_beams
    first = lowest_modes(operators, np.ones(operators.parameters), 1).frequency_hz[0]
    assert band[0] < first < band[1]


@pytest.mark.parametrize("name", shipped_buildings())
def test_a_shipped_building_is_read_by_its_name(name):
    assert load_building(name).name == name
