"""Plans and the view of a building at rest."""

import numpy as np
from matplotlib.text import Text

from femupdate.building import from_document, load_building, mesh_building, to_document
from femupdate.effects import DrawnBuilding, structure_of
from femupdate.report import Geometry, plot_building
from femupdate.report import drawn as signs


def drawn(document):
    building = from_document(document)
    lines = (building.grid.x, building.grid.y)
    return plot_building.story_plans(mesh_building(building), building.story_names, lines)


def test_stories_that_are_alike_share_a_plan():
    document = to_document(load_building("six_story_wall_frame"))
    assert [panel.get_title("left") for panel in drawn(document).axes] == ["S1 to S6"]
    document["walls"] = [{**wall, "stories": ["S1", "S2", "S4"]} for wall in document["walls"]]
    panels = drawn(document).axes
    titles = [panel.get_title("left") for panel in panels if panel.get_visible()]
    assert titles == ["S1 to S2, S4", "S3, S5 to S6"]
    with_walls, without = ({line.get_label() for line in panel.collections} for panel in panels[:2])
    assert with_walls - without == {"wall"}
    document["grid"]["x"] |= {"Y2": 4.5, "Y3": 9.0}
    document["mesh"]["size"] = 1.5
    for wall, story in zip(document["walls"], ("S1", "S2", "S3"), strict=False):
        wall |= {"stories": [story], "stiffness": True}  # two rows of flat plans
    figure = drawn(document)
    figure.canvas.draw()
    seen = [panel for panel in figure.axes if panel.get_visible()]
    assert min(panel.xaxis.label.get_window_extent().y0 for panel in seen) > 0.0


def test_a_wall_is_drawn_from_end_to_end():
    document = to_document(load_building("six_story_wall_frame"))
    (walls,) = (c for c in drawn(document).axes[0].collections if c.get_label() == "wall")
    ends = np.concatenate(walls.get_segments())
    # Two walls along x from Y1 to Y2, on X2 and X3: 1.8 m each.
    assert np.ptp(ends[:, 0]) == np.float64(1.8)
    assert sorted(set(ends[:, 1].round(6))) == [1.5, 3.0]


def test_a_plan_has_the_sensors_above_its_story_alone():
    document = to_document(load_building("six_story_wall_frame"))
    document["walls"] = [{**wall, "stories": ["S1", "S2", "S4"]} for wall in document["walls"]]
    document["sensors"] |= {"points": ["X2-Y2"], "floors": {"4F": ["X1-Y1"], "6F": ["X1-Y1"]}}
    marks = [
        sorted(zip(*line.get_data(), strict=True))
        for panel in drawn(document).axes
        for line in panel.lines
        if line.get_label() == "sensor"
    ]
    assert [len(each) for each in marks] == [1, 2]
    assert marks[0][0] == marks[1][1] != marks[1][0]


def test_the_model_at_rest_has_floors_grid_and_axes():
    building = load_building("two_story_openings")
    seen, lines = DrawnBuilding(structure_of(building)), (building.grid.x, building.grid.y)
    levels, shape = [("base", 0.0), ("2F", 3.0), ("RF", 6.0)], Geometry.of_building(seen)
    view = plot_building.building_view(shape, signs(seen.sensors("RF")), levels, lines)
    texts = {text.get_text() for text in view.findobj(Text)}
    assert {"2F", "RF", *building.grid.x, *building.grid.y, "x", "y", "z"} <= texts
