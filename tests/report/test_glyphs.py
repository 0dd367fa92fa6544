"""Signs on a building: what they are made of, and that an unknown one is refused."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from femupdate.building import from_document, load_building
from femupdate.effects import CATALOGUE, DrawnBuilding, Glyph, structure_of
from femupdate.errors import ReportError
from femupdate.report import Geometry, Glyphs, drawn
from femupdate.report.scenes import draw_marked
from tests import documents

LOW, HIGH = np.zeros(3), np.array([0.0, 0.0, 2.0])


def sign(kind, *arguments):
    return drawn([Glyph.of(kind, *arguments)])


def test_an_unknown_sign_is_refused():
    with pytest.raises(ReportError, match=r"no sign is named 'hook' .*ball, arrow, spring"):
        sign("hook", LOW, HIGH)


@pytest.mark.parametrize("kind", ["arrow", "spring", "dashpot"])
def test_signs_between_two_points_touch_both(kind):
    points = np.concatenate(sign(kind, LOW, HIGH).lines)
    assert points[:, 2].min() == 0.0
    assert points[:, 2].max() == 2.0
    assert np.ptp(points[:, :2]) > 0.1, "they are no plain line"


def test_a_ball_and_surfaces():
    ((centre, radius),) = sign("ball", HIGH, 0.3).balls
    assert (centre.tolist(), radius) == ([0.0, 0.0, 2.0], 0.3)
    wall = np.ones((4, 3))
    assert sign("surfaces", [wall]).faces == (wall,)


def test_a_marked_building_shows_signs_and_floors():
    geometry = Geometry.of([[0, 0, 0], [0, 0, 3], [2, 0, 3], [2, 0, 0]], [[0, 1, 2, 3]], [[0, 1]])
    panel = Figure().subplots()
    wall = sign("surfaces", [np.ones((4, 3))])
    signs = sign("ball", HIGH, 0.1) + sign("spring", LOW, HIGH) + wall
    draw_marked(panel, geometry, signs, [("RF", 3.0)])
    shells, edges, faces, lines, balls, _ = panel.collections
    parts = [len(one.get_paths()) for one in (shells, faces, lines, balls)]
    assert parts == [1, 1, 1, 1]
    assert len(edges.get_segments()) == 4, "the beam lies on an edge of the shell"
    assert [text.get_text() for text in panel.texts] == ["RF", *"xyz"]
    assert signs == signs + Glyphs()


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
