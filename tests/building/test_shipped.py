"""Shipped buildings: the six-story frame, sticks, and all that are examples."""

import numpy as np
import pytest
from scipy.linalg import eigh

from femupdate.building import (
    from_document,
    load_building,
    mesh_building,
    shear_operators,
    shipped_buildings,
)
from femupdate.fe import assemble, lowest_modes

TABLE = {
    0.3: (9204, [3.350, 5.255, 7.046, 10.396, 16.965, 18.343]),
    0.15: (34224, [3.318, 5.251, 7.035, 10.301, 16.960, 18.179]),
}


def frequencies(building, mesh_size=None):
    model = mesh_building(building, mesh_size).model
    return lowest_modes(assemble(model), np.ones(6), 6).frequency_hz


def without_dead_walls(building):
    return building.model_copy(update={"walls": building.walls[:2]})


def test_mesh_is_the_one_of_the_table():
    mesh = mesh_building(load_building("six_story_wall_frame"), 0.3)
    assert mesh.model.dof == 9204
    assert int((~mesh.model.fixed).sum()) == 9072
    assert mesh.floors == ("2F", "3F", "4F", "5F", "6F", "RF")
    np.testing.assert_allclose(mesh.floor_level, 0.9 * np.arange(1, 7), rtol=1e-14)
    assert all(len(nodes) == 2 for nodes in mesh.floor_nodes.values())


def test_shipped_building_lies_within_one_per_cent_of_the_table():
    # It carries its non-structural walls' weight along X1 and X4, the table's does not.
    found = frequencies(load_building("six_story_wall_frame"))
    np.testing.assert_allclose(found, TABLE[0.15][1], rtol=0.01)


def test_frequencies_without_non_structural_walls():
    # Ours at 0.3 m lies within 0.35 % of the limit of the table, by second order from both meshes;
    # ASDShellQ4 at 0.3 m is 1.3 % off it in the first mode. At 0.1 m ours lies within 0.1 % of it.
    coarse, fine = (np.array(TABLE[size][1]) for size in (0.3, 0.15))
    building = without_dead_walls(load_building("six_story_wall_frame"))
    np.testing.assert_allclose(frequencies(building, 0.3), fine - (coarse - fine) / 3, rtol=0.0035)


def test_stiff_non_structural_walls_change_torsion_and_x_but_hardly_y():
    building = load_building("six_story_wall_frame")
    walls = tuple(wall.model_copy(update={"stiffness": True}) for wall in building.walls)
    ratio = (
        frequencies(building.model_copy(update={"walls": walls}))[:3] / frequencies(building)[:3]
    )
    assert ratio[0] == pytest.approx(1.0, abs=0.03)
    assert ratio[1:].min() > 1.25


def stick_frequencies(terms, mass, theta):
    stiffness = np.einsum("p,pij->ij", theta, terms)
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)


def unequal():
    stories = [
        {"name": "S1", "mass": 2e3, "stiffness": 5e6},
        {"name": "S2", "mass": 1e3, "stiffness_per_mass": 3e3},
    ]
    return {
        "name": "two",
        "kind": "shear",
        "stories": stories,
        "frequency_grid": {"start": 0.0, "step": 1.0, "count": 3},
        "prior": {"theta": {"lower": 1, "upper": 2}},
        "damping": {"law": "rayleigh", "ratio": 0.03, "anchors": [2.0, 7.0]},
    }


def test_each_spring_acts_between_its_floors():
    building = from_document(unequal())
    terms, mass = shear_operators(building)
    assert building.masses_known
    np.testing.assert_array_equal(mass, np.diag([2e3, 1e3]))
    np.testing.assert_allclose(terms[0], [[5e6, 0], [0, 0]])
    np.testing.assert_allclose(terms[1], [[3e6, -3e6], [-3e6, 3e6]])
    # Two degrees of freedom by hand: m1 m2 w^4 - (m1 k2 + m2 (k1 + k2)) w^2 + k1 k2 = 0.
    k1, k2, m1, m2 = 10e6, 1.5e6, 2e3, 1e3
    roots = np.roots([m1 * m2, -(m1 * k2 + m2 * (k1 + k2)), k1 * k2])
    np.testing.assert_allclose(
        stick_frequencies(terms, mass, np.array([2.0, 0.5])),
        np.sqrt(np.sort(roots)) / (2 * np.pi),
        rtol=1e-12,
    )


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
