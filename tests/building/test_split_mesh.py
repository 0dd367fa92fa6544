"""A mesh that was read, split in place."""

from dataclasses import replace

import numpy as np
from femupdate.benchmarks.frame_coverage import BUILDING

from femupdate.building import load_building, mesh_building
from femupdate.building.split_mesh import split_mesh
from femupdate.effects.structure import structure_of
from femupdate.fe import RigidLinks, assemble, bulk_data
from tests.building.test_deck import frequencies


def in_order(nodes):
    rounded = np.round(nodes, 6)
    return rounded[np.lexsort(rounded.T)]


def test_frames_are_split_as_meshes_that_were_read(tmp_path):
    """Where sizes divide spans the halves are those of a mesh of half the size."""
    heavy, path = tmp_path / "heavy.toml", tmp_path / "model.bdf"
    heavy.write_text(f'{BUILDING.read_text()}[[floor_mass]]\ntotal = "70 t"\n')
    building = load_building(heavy)
    for size in (0.5, 0.7):  # 3 m at .7 m are 5 parts, and 9 at .35 m
        path.write_text(bulk_data(mesh_building(building, size).model))
        read = load_building(path)
        split = structure_of(read, halved=True).mesh
        grid = structure_of(building, size, halved=True).mesh
        for fine in (grid, mesh_building(building, size / 2.0)) if size == 0.5 else (grid,):
            nodes = split.model.nodes
            np.testing.assert_allclose(in_order(nodes), in_order(fine.model.nodes), atol=1e-5)
            np.testing.assert_allclose(frequencies(split), frequencies(fine), rtol=1e-6)
        asked = read.mesh.model_copy(update={"split": 1})
        asked = mesh_building(read.model_copy(update={"mesh": asked})).model.nodes
        assert np.array_equal(asked, nodes)
        first = mesh_building(read).model.nodes
        assert np.array_equal(nodes[: len(first)], first)


# A plate of triangles and quadrilaterals on an offset beam with a pin, and a rigid pair.
DECK = """\
BEGIN BULK
MAT1,1,3.+10,,.2,2500.
PSHELL,1,1,.2,1
PBAR,2,1,.09,6.75-4,6.75-4,1.1-3
GRID,1,,0.,0.,0.
GRID,2,,4.,0.,0.
GRID,3,,0.,0.,3.
GRID,4,,4.,0.,3.
GRID,5,,0.,4.,3.
GRID,6,,4.,4.,3.
GRID,7,,8.,0.,3.
GRID,8,,4.,0.,3.4
CBAR,1,2,1,3,0.,1.,0.
CBAR,2,2,2,4,0.,1.,0.
CBAR,3,2,3,4,0.,0.,1.,,
,,5,0.,0.,-.3,0.,0.,-.3
CQUAD4,4,1,3,4,6,5
CTRIA3,5,1,4,7,6
RBE2,6,4,123456,8
RBE2,8,3,123456,5
CONM2,7,8,,900.
SPC1,1,123456,1,2
ENDDATA
"""


def test_mass_supports_and_rigid_bodies_stay(tmp_path):
    path = tmp_path / "model.bdf"
    path.write_text(DECK)
    mesh = mesh_building(load_building(path))
    split = split_mesh(mesh)
    for axis in range(3):
        masses = []
        for model in (mesh.model, split.model):
            operators = assemble(model)
            unit = operators.rigid_translation(axis)
            masses.append(unit @ (operators.mass_full @ unit))
        np.testing.assert_allclose(masses[1], masses[0], rtol=1e-12)
    np.testing.assert_allclose(frequencies(split, 3), frequencies(mesh, 3), rtol=0.1)
    nodes, links = split.model.nodes, split.model.links
    (between,) = np.flatnonzero((nodes == [0.0, 2.0, 3.0]).all(axis=1))
    assert links.master[links.slave == between].tolist() == [2]
    weights = split.of_coarser
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(weights @ mesh.model.nodes, split.model.nodes)


def test_a_beam_at_the_edge_of_a_wall_is_held_as_firmly_after_a_split(tmp_path):
    building, size = load_building("two_story_openings"), 1.2
    coarse, fine = mesh_building(building, size), mesh_building(building, size / 2.0)
    path = tmp_path / "model.bdf"
    bare = replace(coarse.model, links=RigidLinks())  # as other programs join a beam to a wall
    path.write_text(bulk_data(bare))
    split = split_mesh(mesh_building(load_building(path)))
    # Their links are as long as the new sides, those of the fine mesh as the beams are deep.
    np.testing.assert_allclose(frequencies(split, 4), frequencies(fine, 4), rtol=0.012)


def test_a_strut_stays_whole(tmp_path):
    """Its middle would swing by itself at a tenth of a hertz, and take half of its mass along."""
    points = [(0.0, 0.0), (4.0, 0.0), (0.0, 3.0), (4.0, 3.0)]
    cards = [f"GRID,{n},,{x},0.,{z}" for n, (x, z) in enumerate(points, 1)]
    cards += ["CBAR,1,1,1,3,1.,0.,0.", "CBAR,2,1,2,4,1.,0.,0.", "CBAR,3,1,3,4,0.,0.,1."]
    cards += ["CROD,4,2,1,4", "PBARL,1,1,,BAR", "+,.3,.4", "PROD,2,1,.06", "MAT1,1,3.+10,,.2,2500."]
    path = tmp_path / "model.bdf"
    path.write_text("\n".join(["BEGIN BULK", *cards, "SPC1,1,123456,1,2"]))
    coarse = mesh_building(load_building(path, "N,m"))
    fine = split_mesh(coarse)
    assert [len(block) for block in fine.model.elements] == [7]
    assert len(fine.parts[0]) == 7
    np.testing.assert_allclose(frequencies(fine, 2), frequencies(coarse, 2), rtol=0.02)
    assert any("mesh.diaphragms" in note for note in coarse.notes)  # beams alone
