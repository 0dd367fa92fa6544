"""Mode shape pictures: rendered where that is possible, drawn where it is not."""

import os
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.text import Text

from femupdate.building import from_document, load_building, mesh_building, to_document
from femupdate.effects import DrawnBuilding, structure_of
from femupdate.report import Geometry, plot_building
from femupdate.report import drawn as signs
from femupdate.report.geometry import at_levels, outline
from femupdate.report.scenes import mode_shape_figure, probe, rendering

FLOORS = (("base", 0.0), ("2F", 0.9), ("RF", 1.8))


def frame(stories: int = 2) -> Geometry:
    """Two bays by one, slabs of 2 x 2 shells a bay, columns at the corners."""
    x, y, z = np.arange(5) * 0.9, np.arange(3) * 0.75, np.arange(stories + 1) * 0.9
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    index = np.arange(grid[..., 0].size).reshape(grid.shape[:3])
    slabs = [
        [index[i, j, k], index[i + 1, j, k], index[i + 1, j + 1, k], index[i, j + 1, k]]
        for k in range(1, stories + 1)
        for i in range(4)
        for j in range(2)
    ]
    columns = [
        [index[i, j, k], index[i, j, k + 1]]
        for k in range(stories)
        for i in (0, 2, 4)
        for j in (0, 2)
    ]
    return Geometry.of(grid.reshape(-1, 3), slabs, columns)


def sway(geometry: Geometry) -> np.ndarray:
    height = geometry.nodes[:, 2:3]
    return np.hstack([height**1.5, 0.1 * height * geometry.nodes[:, :1], 0.0 * height])


def panels_of(figure, count):
    """The panels with buildings; colour bars follow them."""
    return figure.axes[:count]


def needs_pyvista():
    if rendering():
        pytest.skip(f"PyVista cannot render here: {rendering()}")


@pytest.mark.parametrize("spread", [True, False])
def test_scene_drawn_by_matplotlib(spread):
    geometry = frame()
    sd = 0.02 * geometry.nodes[:, 2] if spread else None
    figure = mode_shape_figure(
        geometry, sway(geometry), FLOORS, shape_sd=sd, title="Mode 1", renderer="matplotlib"
    )
    count = 1 + spread
    headings = ["Mean shape" if spread else "Shape", "Spread of the posterior"][:count]
    for panel, heading in zip(panels_of(figure, count), headings, strict=True):
        assert panel.get_title(loc="left") == heading
        rest, building, _ = panel.collections
        assert len(rest.get_segments()) == len(outline(geometry))
        assert len(building.get_paths()) == len(geometry.shells) + len(geometry.beams)
        assert len(np.unique(building.get_facecolors(), axis=0)) > 3, "a field of many colours"
    bars = [bar.get_xlabel() for bar in figure.axes[count:]]
    assert (
        bars
        == ["Displacement over its largest", "Standard deviation, % of the largest displacement"][
            :count
        ]
    )
    assert [text.get_text() for text in figure.texts] == [
        "Mode 1",
        "Displacements are enlarged; grey lines: the building at rest",
    ]


def test_scene_rendered_by_pyvista():
    needs_pyvista()
    geometry = frame()
    sd = 0.02 * geometry.nodes[:, 2]
    figure = mode_shape_figure(geometry, sway(geometry), FLOORS, shape_sd=sd, renderer="pyvista")
    for panel in panels_of(figure, 2):
        picture = panel.images[0].get_array() / 255.0
        assert (picture.min(axis=-1) < 0.9).mean() > 0.15, "a building fills its panel"
        hues = np.unique((picture.reshape(-1, 3) * 15).astype(int), axis=0)
        assert len(hues) > 30, "a field has many colours"


@pytest.mark.parametrize("part", ["shells", "beams"])
def test_scene_of_shells_alone_and_of_beams_alone(part):
    whole = frame()
    parts = {"shells": whole.shells, "beams": whole.beams}
    geometry = Geometry.of(whole.nodes, **{k: v if k == part else [] for k, v in parts.items()})
    figure = mode_shape_figure(geometry, sway(geometry), FLOORS, renderer="matplotlib")
    assert len(figure.axes[0].collections[1].get_paths()) == len(parts[part])
    needs_pyvista()
    figure = mode_shape_figure(geometry, sway(geometry), FLOORS, renderer="pyvista")
    assert (figure.axes[0].images[0].get_array().min(axis=-1) < 230).mean() > 0.02


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "crashes"),
        ("raise SystemExit(139)", "crashes"),
        ("raise SystemExit(3)", "blank"),
        ("raise ModuleNotFoundError('no module named pyvista')", "no module named pyvista"),
        ("raise SystemExit(7)", "exit status 7"),
    ],
)
def test_probe_survives_what_it_probes(code, reason):
    assert reason in probe((sys.executable, "-c", code))


def test_rendering_writes_nothing_to_the_terminal():
    """VTK tells stderr of every graphics library that it tries and misses."""
    needs_pyvista()
    code = (
        "import numpy as np;"
        "from femupdate.report.geometry import Geometry;"
        "from femupdate.report.scenes import mode_shape_figure;"
        "g = Geometry.of(np.eye(4, 3), [[0, 1, 2, 3]], [[0, 1]]);"
        "mode_shape_figure(g, np.ones((4, 3)), [('base', 0.0)], renderer='pyvista')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        check=True,
        env={**os.environ, "DISPLAY": ""},
    )
    assert done.stdout + done.stderr == b""


def test_floors_that_would_be_written_over_each_other_share_a_name():
    floors = [("base", 0.0), ("2F", 4.0), ("3F", 7.0), ("4F", 4.0), ("RF", 7.3)]
    assert at_levels(floors, 18.0) == [("base", 0.0), ("2F, 4F", 4.0), ("3F, RF", 7.0)]


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
