"""What holds for elements of every kind: how they are found, chosen, cut, scaled and checked."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.errors import StructureError
from femupdate.fe import Beams, Shells, Triangles, cell_types, element_for, element_kinds
from tests.fe import meshes


@pytest.fixture
def model():
    points, elements = meshes.frame_with_wall()
    fixed = meshes.hold(len(points), (points[:, 2] == 0, range(6)))
    return meshes.model(points, fixed, groups=2, **elements)


def test_the_kinds_of_the_folder_are_found():
    assert element_kinds() == {"beam": Beams, "shell": Shells, "triangle": Triangles}
    assert cell_types() == {"line": 2, "quad": 4, "triangle": 3}


@pytest.mark.parametrize("cell_type", ["line", "triangle", "quad"])
def test_each_type_of_cell_has_one_usual_kind(cell_type):
    usual = [k for k in element_kinds().values() if k.cell_type == cell_type and k.standard]
    assert usual == [element_for(cell_type)]
    assert element_for(cell_type, usual[0].name) is usual[0]


def test_a_kind_of_other_cells_is_refused():
    with pytest.raises(StructureError, match=r"no element named 'beam' is made of quad"):
        element_for("quad", "beam")


def test_some_elements_have_their_own_matrices(model):
    chosen = np.array([3, 1])
    shells = model.elements_of(Shells)
    some, every = (one.matrices(model.nodes) for one in (shells.taken(chosen), shells))
    np.testing.assert_allclose(some.stiffness, every.stiffness[chosen], rtol=1e-9, atol=1e-3)
    released = np.zeros((2, 12), dtype=bool)
    beams = replace(model.elements_of(Beams), released=released).taken(chosen[:1] - 2)
    assert beams.offset is None
    assert beams.released.shape == (1, 12)


@pytest.mark.parametrize("kind", [Shells, Beams])
def test_scaled_elements_are_stiffer_and_weigh_the_same(model, kind):
    block = model.elements_of(kind)
    factor = np.linspace(0.5, 3.0, len(block))
    before, after = (one.matrices(model.nodes) for one in (block, block.scaled(factor)))
    np.testing.assert_allclose(after.stiffness, factor[:, None, None] * before.stiffness, rtol=1e-9)
    np.testing.assert_allclose(after.mass, before.mass, rtol=1e-9, atol=1e-9)


def test_a_model_keeps_the_order_of_its_blocks_and_drops_empty_ones(model):
    shells, beams = model.elements
    assert [type(block) for block in model.elements] == [Shells, Beams]
    changed = replace(model, elements=(shells.taken(np.array([0, 1])), beams, Triangles()))
    assert [len(block) for block in changed.elements] == [2, len(beams)]
    assert len(model.elements_of(Triangles)) == 0
    assert model.element_count == len(model.faces) + len(model.lines) == len(shells) + len(beams)
