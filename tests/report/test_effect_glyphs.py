"""Where effects are drawn: every one of the catalogue, at every place, on the building itself."""

import numpy as np
import pytest

from femupdate.building import from_document, load_building
from femupdate.effects import CATALOGUE, DrawnBuilding, structure_of
from femupdate.report import Geometry, drawn
from tests import documents


@pytest.fixture(scope="module", params=["shear_4dof", "two_story_openings"])
def building(request):
    return drawn_building(request.param)


def drawn_building(name):
    return DrawnBuilding(structure_of(load_building(name)))


@pytest.mark.parametrize("name", list(CATALOGUE))
def test_every_effect_is_drawn_on_or_beside_the_building(building, name):
    size = Geometry.of_building(building).size
    assert building.size == size
    for place in CATALOGUE[name].places(building.structure):
        glyphs = drawn(CATALOGUE[name].glyphs(building, place))
        centres = [centre[None] for centre, _ in glyphs.balls]
        points = np.concatenate([*centres, *glyphs.lines, *glyphs.faces])
        assert (points > building.low - 0.3 * size).all()
        assert (points < building.high + 0.3 * size).all()


@pytest.mark.parametrize("name", [name for name, one in CATALOGUE.items() if one.instrument])
def test_effects_in_the_measurement_are_drawn_as_sensors(building, name):
    effect = CATALOGUE[name]
    kinds = {
        one.kind
        for place in effect.places(building.structure)
        for one in effect.glyphs(building, place)
    }
    assert kinds == ({"ball"} if name == "base_gain" else {"sensor"})


def test_both_of_two_channels_are_drawn(building):
    floors = building.structure.floors
    apart = [len(building.sensors(floor)) for floor in floors]
    assert len(building.sensors(",".join(floors[:2]))) == sum(apart[:2])
    assert len(building.sensors("floors")) == sum(apart)


def test_what_sits_on_a_floor_is_drawn_at_its_height():
    building = drawn_building("shear_4dof")
    heights = []
    for floor in building.structure.floors:
        ((centre, radius),) = drawn(CATALOGUE["added_mass"].glyphs(building, floor)).balls
        heights.append(centre[2] - radius)
    np.testing.assert_allclose(heights, building.structure.levels)


def test_effects_of_one_tower_are_drawn_in_it():
    building = DrawnBuilding(structure_of(from_document(documents.towers())))
    for name, place in [("added_mass", "6F"), ("brace", "3F-6F"), ("story_damper", "6F")]:
        glyphs = drawn(CATALOGUE[name].glyphs(building, place))
        centres = [centre[None] for centre, _ in glyphs.balls]
        across = np.concatenate([*centres, *glyphs.lines])[:, 0]
        assert ((across >= 12.0) & (across <= 18.0)).all(), name


def test_the_walls_of_one_story_are_those_of_that_story():
    building = drawn_building("two_story_openings")
    structure, effect = building.structure, CATALOGUE["wall_stiffness"]
    story = structure.building.story_names[1]
    assert story in effect.places(structure)
    faces = np.stack(drawn(effect.glyphs(building, story)).faces)
    low, high = structure.levels
    assert faces[..., 2].min() == pytest.approx(low)
    assert faces[..., 2].max() == pytest.approx(high)
