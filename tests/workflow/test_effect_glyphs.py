"""Where effects are drawn: every one of the catalogue, at every place, on the building itself."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from femupdate.building.files import load_building
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import structure_of
from femupdate.report.marked_building import draw_marked
from femupdate.workflow.effect_glyphs import effect_glyphs, geometry_of


@pytest.fixture(scope="module", params=["shear_4dof", "two_story_openings"])
def structure(request):
    return structure_of(load_building(request.param))


@pytest.mark.parametrize("name", list(CATALOGUE))
def test_every_effect_is_drawn_on_or_beside_the_building(structure, name):
    geometry = geometry_of(structure)
    low, high = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
    for place in CATALOGUE[name].places(structure):
        glyphs = effect_glyphs(structure, geometry, Placed(CATALOGUE[name], place))
        centres = [centre[None] for centre, _ in glyphs.balls]
        points = np.concatenate([*centres, *glyphs.lines, *glyphs.faces])
        assert (points > low - 0.3 * geometry.size).all()
        assert (points < high + 0.3 * geometry.size).all()


def test_what_sits_on_a_floor_is_drawn_at_its_height():
    structure = structure_of(load_building("shear_4dof"))
    geometry = geometry_of(structure)
    heights = []
    for floor in structure.floors:
        placed = Placed(CATALOGUE["added_mass"], floor)
        ((centre, radius),) = effect_glyphs(structure, geometry, placed).balls
        heights.append(centre[2] - radius)
    np.testing.assert_allclose(heights, structure.levels)


def test_the_walls_of_one_story_are_those_of_that_story():
    structure = structure_of(load_building("two_story_openings"))
    geometry = geometry_of(structure)
    effect = CATALOGUE["wall_stiffness"]
    story = structure.building.story_names[1]
    assert story in effect.places(structure)
    faces = np.stack(effect_glyphs(structure, geometry, Placed(effect, story)).faces)
    low, high = structure.levels
    assert faces[..., 2].min() == pytest.approx(low)
    assert faces[..., 2].max() == pytest.approx(high)


def test_without_a_renderer_the_same_is_drawn():
    structure = structure_of(load_building("shear_4dof"))
    geometry = geometry_of(structure)
    glyphs = effect_glyphs(structure, geometry, Placed(CATALOGUE["tuned_appendage"], "3F"))
    panel = Figure().subplots()
    floors = list(zip(structure.floors, structure.levels, strict=True))
    draw_marked(panel, geometry, glyphs, floors, "matplotlib")
    assert [text.get_text() for text in panel.texts] == ["2F", "3F", "4F", "RF"]
    assert sum(len(c.get_paths()) for c in panel.collections) >= len(geometry.shells) + 2
