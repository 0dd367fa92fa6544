"""The six-story wall-frame building against frequencies computed with OpenSees 3.7.1.

The table: ASDShellQ4 and ElasticTimoshenkoBeam (shear areas 5/6 A, consistent beam mass) on the
mid-planes, self mass from the density, the rest of 21.5 t a floor at the slab nodes by tributary
area; modes Y, torsion, X, Y, torsion, Y. It is reproduced in every digit when a floor's self weight
is that of its slab and beams and of the columns and shear walls below it, both shear walls stand in
the same bay, and non-structural walls are left out.
"""

import numpy as np
import pytest

from femupdate.building import load_building, mesh_building
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
