"""Meshes of frame buildings: geometry, ownership, masses, supports, sensors."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from femupdate.building import from_document, load_building, mesh_building, self_mass
from femupdate.dynamics import mesh_modes
from femupdate.effects import structure_of
from femupdate.errors import BuildingError
from femupdate.fe import Beams, Shells, assemble, lowest_modes, static_displacement
from tests.building.frames import SMALL, make_document

DENSITY = 2400.0
COLUMN, BEAM = 0.4 * 0.6, 0.3 * 0.5  # m2, as the maker of documents has them
SLAB = 0.15  # m


def total_mass(mesh):
    return float(self_mass(mesh.model, []).sum() + mesh.model.masses.mass[:, 0].sum())


widths = st.lists(st.floats(2.0, 8.0), min_size=1, max_size=3)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    heights=st.lists(st.floats(2.0, 5.0), min_size=1, max_size=4),
    bays=st.tuples(widths, widths),
    size=st.floats(0.8, 6.0),
)
def test_a_building_of_any_size_weighs_what_its_drawings_say(heights, bays, size):
    mesh = mesh_building(from_document(make_document(heights, bays, size)))
    depth, width = sum(bays[1]), sum(bays[0])
    columns = (len(bays[0]) + 1) * (len(bays[1]) + 1) * COLUMN * np.array(heights)
    beams = ((len(bays[1]) + 1) * width + (len(bays[0]) + 1) * depth) * BEAM
    per_story = DENSITY * (columns + beams + width * depth * SLAB)
    # Sums of products in another order: rounding alone.
    np.testing.assert_allclose(self_mass(mesh.model, []), per_story, rtol=1e-12)
    document = make_document(heights, bays, size, floor_mass=2.0 * per_story.max())
    loaded = mesh_building(from_document(document))
    assert total_mass(loaded) == pytest.approx(2.0 * per_story.max() * len(heights), rel=1e-12)
    model = mesh.model
    used = np.unique(
        np.concatenate(
            [model.elements_of(Shells).nodes.ravel(), model.elements_of(Beams).nodes.ravel()]
        )
    )
    np.testing.assert_array_equal(used, np.arange(len(model.nodes)))
    assert len(np.unique(model.nodes, axis=0)) == len(model.nodes)
    assert (
        set(model.elements_of(Shells).group)
        == set(model.elements_of(Beams).group)
        == set(range(len(heights)))
    )
    assert model.elements_of(Beams).measure(model.nodes).max() <= size * (1 + 1e-6)
    np.testing.assert_array_equal(mesh.base_nodes, np.flatnonzero(model.nodes[:, 2] == 0.0))
    assert len(mesh.base_nodes) == (len(bays[0]) + 1) * (len(bays[1]) + 1)
    assert model.fixed[mesh.base_nodes].all()
    assert model.fixed.sum() == 6 * len(mesh.base_nodes)


@pytest.mark.parametrize("stories", [1, 2, 12])
def test_a_building_of_other_height_needs_no_code_and_stands(stories):
    heights = [3.0 + 0.1 * n for n in range(stories)]
    walls = [{"along": "Y1", "from": "X0", "to": "X1", "thickness": 0.2}]
    document = make_document(heights, ([5.0, 6.0], [4.0]), 2.5, 80e3, walls)
    mesh = mesh_building(from_document(document))
    assert mesh.model.groups == stories
    assert mesh.floors == (*(f"{n}F" for n in range(2, stories + 1)), "RF")
    np.testing.assert_allclose(mesh.floor_level, np.cumsum(heights), rtol=1e-14)
    assert total_mass(mesh) == pytest.approx(80e3 * stories, rel=1e-12)
    frequencies = lowest_modes(assemble(mesh.model), np.ones(stories), 3).frequency_hz
    assert np.all(frequencies > 0.1)
    # A framed building's first period lies near 0.1 s a story (a rule of thumb of codes).
    assert 0.3 < frequencies[0] * 0.1 * stories < 3.0


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL, encoding="utf-8")
    return load_building(path)


def test_each_story_owns_what_carries_its_floor_and_the_floor(small):
    model = mesh_building(small).model
    low, high = 3.2, 6.0
    shell_z = model.nodes[model.elements_of(Shells).nodes][:, :, 2]
    beam_z = model.nodes[model.elements_of(Beams).nodes][:, :, 2]
    for kind, z, elements in (
        ("wall", shell_z, model.elements_of(Shells)),
        ("slab", shell_z, model.elements_of(Shells)),
        ("column", beam_z, model.elements_of(Beams)),
        ("beam", beam_z, model.elements_of(Beams)),
    ):
        for group, (bottom, top) in enumerate([(0.0, low), (low, high)]):
            heights = z[(elements.kind == kind) & (elements.group == group)]
            assert len(heights)
            assert heights.max() == pytest.approx(top)
            floor_only = kind in ("slab", "beam")
            assert heights.min() == pytest.approx(top if floor_only else bottom)


def test_columns_and_beams_share_the_nodes_of_walls_and_slabs(small):
    model = mesh_building(small).model
    wall = np.unique(model.elements_of(Shells).nodes[model.elements_of(Shells).kind == "wall"])
    column = np.unique(model.elements_of(Beams).nodes[model.elements_of(Beams).kind == "column"])
    edge = wall[np.isclose(model.nodes[wall, 0], 4.0)]
    assert len(edge) == 4 + 3 + 1  # 3.2 m in four parts, 2.8 m in three
    assert np.isin(edge, column).all()
    slab = np.unique(model.elements_of(Shells).nodes[model.elements_of(Shells).kind == "slab"])
    beam = np.unique(model.elements_of(Beams).nodes[model.elements_of(Beams).kind == "beam"])
    assert np.isin(beam, slab).all()
    shared = np.intersect1d(wall, slab)
    assert len(shared) == 2 * 5  # on both floors, 4 m in four parts


def test_sections_stand_as_the_file_says(small):
    beams = mesh_building(small).model.elements_of(Beams)
    column = np.flatnonzero(beams.kind == "column")[0]
    # Width 300 mm along x (local y), depth 500 mm along y (local z).
    assert beams.inertia_y[column] == pytest.approx(0.3 * 0.5**3 / 12, rel=1e-12)
    assert beams.inertia_z[column] == pytest.approx(0.5 * 0.3**3 / 12, rel=1e-12)
    np.testing.assert_array_equal(beams.up[column], [0, 1, 0])
    girder = np.flatnonzero(beams.kind == "beam")[0]
    assert beams.inertia_y[girder] == pytest.approx(0.25 * 0.4**3 / 12, rel=1e-12)
    assert beams.shear_area_z[girder] == pytest.approx(0.25 * 0.4 * 5 / 6, rel=1e-12)
    np.testing.assert_array_equal(beams.up[girder], [0, 0, 1])


def test_a_deep_column_is_stiff_along_its_depth():
    """One column under a tiny slab: f follows 3 E I / (m h^3), with I of the direction."""
    document = make_document([4.0], ([0.01], [0.01]), 10.0, 20e3)
    document["beams"] = []
    document["columns"] = [{"section": "column", "at": "X0-Y0"}]
    document["sections"]["column"] = {"shape": "rectangle", "width": 0.1, "depth": 0.2}
    model = mesh_building(from_document(document)).model
    operators = assemble(model)
    modes = lowest_modes(operators, np.ones(1), 2)
    inertias = np.array([0.2 * 0.1**3, 0.1 * 0.2**3]) / 12
    expected = np.sqrt(3 * 25e9 * inertias / (20e3 * 4.0**3)) / (2 * np.pi)
    # Shear deformation (under 0.3 %), the column's own mass (0.96 t of the 20 t is not all at the
    # top: some 2 %) and the slab's size are left out of the closed form.
    np.testing.assert_allclose(modes.frequency_hz, expected, rtol=0.03)
    top = np.argmax(model.nodes[:, 2])
    first = np.abs(operators.expand(modes.shapes).reshape(-1, 6, 2)[top, :2, 0])
    assert first[0] > 10 * first[1]  # the weak axis bends along x, where the width lies


def test_wall_without_stiffness_weighs_on_both_floors(small):
    mesh = mesh_building(small)
    wall = DENSITY * 0.1 * 5.0 * np.array([3.2, 2.8])
    # All is counted in the floor masses but what rests on the ground.
    assert total_mass(mesh) == pytest.approx(2 * 60e3 - wall[0] / 2, rel=1e-12)
    assert "non_structural_wall" not in mesh.model.elements_of(Shells).kind
    without = small.model_copy(update={"walls": small.walls[:1]})
    heavy, light = (
        (m := mesh_building(b).model.masses, np.bincount(m.node, m.mass[:, 0]))[1]
        for b in (small, without)
    )
    nodes = mesh.model.nodes
    rest = np.array([60e3, 60e3]) - self_mass(mesh_building(without).model, [])
    for level, moved, left in (
        (3.2, wall.sum() / 2, 1 - wall[0] / rest[0]),
        (6.0, wall[1] / 2, 1 - wall[1] / rest[1]),
    ):
        on_floor = np.isclose(nodes[:, 2], level)
        line = on_floor & np.isclose(nodes[:, 0], 7.0)
        padded = np.zeros((2, len(nodes)))
        padded[0, : len(heavy)], padded[1, : len(light)] = heavy, light
        extra = padded[0] - left * padded[1]  # the spread rest shrinks by the wall's self weight
        assert extra[line].sum() == pytest.approx(moved, rel=1e-9)
        np.testing.assert_allclose(extra[on_floor & ~line], 0.0, atol=1e-9 * 60e3)


@pytest.mark.parametrize(
    ("lines", "named"), [(("X0", "Y0"), {"X+Y", "torsion"}), (("X0", "X2"), {"X", "Y"})]
)
def test_modes_across_the_diagonal_are_named_so(lines, named):
    walls = [
        {"along": line, "from": f"{across}0", "to": f"{across}2", "thickness": 0.1}
        for line, across in zip(lines, ("Y" if n[0] == "X" else "X" for n in lines), strict=True)
    ]
    document = make_document([3.0], ([4.0, 4.0], [4.0, 4.0]), 2.0, walls=walls)
    modes = mesh_modes(structure_of(from_document(document)))
    driven = modes.effective_mass.max(axis=1) > 0.1
    # Slabs swing along with the first mode.
    assert {modes.direction[k] for k in driven.nonzero()[0]} - {"floors"} == named


YOUNG, SIDE, HEIGHT = 30e9, 0.4, 3.0
AREA, INERTIA = SIDE**2, SIDE**4 / 12
SHEAR = 5 / 6 * AREA * YOUNG / 2.4


def own_mesh(folder, points, groups, parts):
    """A building of one story with line cells in numbered groups, as its model."""
    cells = [("line", np.array(group)) for group in groups]
    tags = [np.full(len(group), k) for k, group in enumerate(groups, 1)]
    path = folder / "own.vtu"
    meshio.Mesh(np.array(points, dtype=float), cells, cell_data={"part": tags}).write(path)
    return from_document(
        {
            "name": "own",
            "kind": "mesh",
            "mesh": {"file": str(path), "unit": "m", "tags": "part"},
            "stories": [{"name": "S1", "height": HEIGHT}],
            "materials": {"c": {"youngs_modulus": YOUNG, "poisson_ratio": 0.2, "density": 2500.0}},
            "sections": {"square": {"shape": "rectangle", "width": SIDE, "depth": SIDE}},
            "parts": [
                {"group": str(k), "section": "square", **part} for k, part in enumerate(parts, 1)
            ],
            "sensors": {"direction": "x", "points": [[0.0, 0.0]]},
            "frequency_grid": {"start": 0.1, "step": 0.1, "count": 100},
            "prior": {"theta": {"lower": 0.5, "upper": 2.0}},
            "damping": {"law": "constant", "ratio": 0.02},
        }
    )


def pushed(building, load_at, load):
    """Displacements (N, 6) under a load at the node nearest to a place, and the nodes."""
    model = mesh_building(building).model
    node = int(np.linalg.norm(model.nodes - load_at, axis=1).argmin())
    force = np.zeros((len(model.nodes), 6))
    force[node] = load
    moved = static_displacement(assemble(model), np.ones(1), force.ravel()).reshape(-1, 6)
    return moved[node]


def column(folder, count=4, **part):
    """A cantilever column of a few elements whose nodes run now up, now down."""
    points = np.column_stack([np.zeros((count + 1, 2)), np.linspace(0, HEIGHT, count + 1)])
    lines = [[k, k + 1][:: -1 if k % 2 else 1] for k in range(count)]
    return own_mesh(folder, points, [lines], [part])


def test_an_eccentric_column_bends_when_it_is_pressed(tmp_path):
    """0.2 m beside its nodes, pressed at the node: N h / EA + N e^2 h / EI, and N e h^2 / 2 EI."""
    building = column(tmp_path, eccentricity=[0.2, 0.0, 0.0])
    moved = pushed(building, [0, 0, HEIGHT], [0, 0, -1e6, 0, 0, 0])
    short = 1e6 * HEIGHT / YOUNG / AREA
    assert moved[2] == pytest.approx(-short - 1e6 * 0.04 * HEIGHT / YOUNG / INERTIA, rel=1e-9)
    # The force stands at -0.2 m from the axis and bends the column that way.
    assert moved[0] == pytest.approx(-1e6 * 0.2 * HEIGHT**2 / 2 / YOUNG / INERTIA, rel=1e-9)


@pytest.mark.parametrize("count", [1, 5])
def test_rigid_ends_shorten_a_column(tmp_path, count):
    """Rigid over 0.5 m at the foot and 0.3 m at the head, pushed at the head."""
    building = column(tmp_path, count, rigid_ends=[0.5, 0.3])
    found = pushed(building, [0, 0, HEIGHT], [1e5, 0, 0, 0, 0, 0])[0]
    clear, arm, bending = HEIGHT - 0.8, 0.3, YOUNG * INERTIA
    moment = 1e5 * arm
    end = 1e5 * clear**3 / 3 / bending + moment * clear**2 / 2 / bending + 1e5 * clear / SHEAR
    slope = 1e5 * clear**2 / 2 / bending + moment * clear / bending
    assert found == pytest.approx(end + arm * slope, rel=1e-9)


def portal(folder, backwards, **beam):
    """Two columns, 6 m apart, and a beam of three elements between their heads."""
    x = [0.0, 2.0, 4.0, 6.0]
    points = [[0, 0, 0], [6, 0, 0], *([place, 0, HEIGHT] for place in x)]
    lines = [[2, 3], [3, 4], [4, 5]]
    lines = [line[::-1] for line in lines[::-1]] if backwards else lines
    return own_mesh(folder, points, [[[0, 2], [5, 1]], lines], [{}, beam])


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("hinges", ["start", "end", "both"])
def test_a_portal_with_a_hinged_beam(tmp_path, backwards, hinges):
    """Hinged at both ends, the column that is pushed and the other one share the force, N / EA
    apart; hinged at one, that column takes less than the other, which the beam holds back."""
    building = portal(tmp_path, backwards, hinges=hinges)
    model = mesh_building(building).model
    load = np.zeros((len(model.nodes), 6))
    heads = [int(np.linalg.norm(model.nodes - [x, 0, HEIGHT], axis=1).argmin()) for x in (0, 6)]
    load[heads, 0] = 5e4
    fixed = model.fixed.copy()
    fixed[:, [1, 3, 5]] = True
    operators = assemble(replace(model, fixed=fixed))
    moved = static_displacement(operators, np.ones(1), load.ravel()).reshape(-1, 6)
    cantilever = 5e4 * HEIGHT**3 / 3 / YOUNG / INERTIA + 5e4 * HEIGHT / SHEAR
    sway = moved[heads, 0]
    if hinges == "both":
        np.testing.assert_allclose(sway, cantilever, rtol=1e-9)
        return
    assert (sway < 0.95 * cantilever).all()
    # The head with the hinge turns further: it has no beam to hold it.
    free, held = (0, 1) if hinges == "start" else (1, 0)
    assert moved[heads[free], 4] > 1.2 * moved[heads[held], 4]


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ({"hinges": "middle"}, r"parts\[0\]\.hinges: 'middle' is not known"),
        (
            {"rigid_ends": [1.0, 0.0]},
            r"nothing of the element at \(0, 0, 0\.5\) m, 1 m long; short",
        ),
        ({"eccentricity": [0.1, 0.0]}, r"parts\[0\]\.eccentricity"),
    ],
    ids=["hinges", "rigid_ends", "eccentricity"],
)
def test_wrong_ends_are_told(tmp_path, part, words):
    with pytest.raises(BuildingError, match=words):
        mesh_building(column(tmp_path, 3, **part))
