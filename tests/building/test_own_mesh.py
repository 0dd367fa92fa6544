"""Buildings from a user's own mesh: read back exactly, and wrong meshes told in words."""

import re

import meshio
import numpy as np
import pytest
from femupdate.benchmarks.mesh_export import export_mesh

from femupdate.building import (
    from_document,
    load_building,
    mechanics_hash,
    mesh_building,
    save_building,
    self_mass,
    to_document,
)
from femupdate.errors import BuildingError
from femupdate.fe import Beams, Shells, Triangles, assemble, lowest_modes
from tests.building.test_deck import frequencies

NUMBERS = {"slab": "1", "wall": "2", "column": "4", "beam": "5"}

OWN = """
name = "own"
kind = "mesh"
frequency_grid = { start = "0.1 Hz", step = "0.1 Hz", count = 100 }
prior.theta = { lower = 0.5, upper = 2 }
damping = { law = "constant", ratio = 0.02 }
stories = [{ name = "S1", height = "3 m" }]
materials.concrete = { youngs_modulus = "30 GPa", poisson_ratio = 0.2, density = "2400 kg/m3" }
sections.column = { shape = "rectangle", width = "300 mm", depth = "400 mm" }

[mesh]
file = "own.vtu"
unit = "m"
tags = "part"

[[parts]]
group = "1"
thickness = "200 mm"

[[parts]]
group = "2"
section = "column"

[sensors]
direction = "x"
points = [["0 m", "0 m"]]
"""


@pytest.mark.parametrize("ending", ["vtu", "msh", "med"])
def test_the_six_story_building_comes_back_with_its_frequencies(ending, tmp_path):
    building = load_building("six_story_wall_frame")
    building = building.model_copy(update={"walls": building.walls[:2]})
    mesh = mesh_building(building, 0.6)
    path = export_mesh(mesh, tmp_path / f"six.{ending}")
    plain = to_document(building)
    shared = (
        "stories",
        "materials",
        "sections",
        "floor_mass",
        "frequency_grid",
        "prior",
        "damping",
    )
    name = NUMBERS if ending == "vtu" else {kind: kind for kind in NUMBERS}
    document = {key: plain[key] for key in shared} | {
        "name": "own",
        "kind": "mesh",
        "mesh": {"file": str(path), "unit": "m"} | ({"tags": "group"} if ending == "vtu" else {}),
        "parts": [
            {"group": [name["slab"], name["wall"]], "thickness": 0.06},
            {"group": name["column"], "section": "column"},
            {"group": name["beam"], "section": "beam"},
        ],
        "sensors": {"direction": "x", "points": [[1.8, 0.0], [1.8, 4.5]]},
    }
    own = mesh_building(from_document(document))
    np.testing.assert_allclose(frequencies(own), frequencies(mesh), rtol=1e-9)
    assert own.floors == mesh.floors
    for floor in mesh.floors:
        mine, theirs = own.model.nodes[own.floor_nodes[floor]], mesh.floor_nodes[floor]
        np.testing.assert_allclose(mine, mesh.model.nodes[theirs], atol=1e-12)
    # Theta scales the same elements: each term of the stiffness has the same frequencies.
    theta = np.array([0.5, 1, 2, 0.7, 1.4, 3])
    one, other = (lowest_modes(assemble(m.model), theta, 3).frequency_hz for m in (own, mesh))
    np.testing.assert_allclose(one, other, rtol=1e-9)


POINTS = np.array(
    [
        *([x, y, z] for z in (0.0, 3.0) for y in (0.0, 4.0) for x in (0.0, 5.0)),
        [2.5, 2.0, 3.0],
    ]
)
# A table: four columns under a slab of four triangles around its middle.
COLUMNS = np.array([[k, k + 4] for k in range(4)])
SLAB = np.array([[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]])


def write(folder, points=POINTS, cells=None, data=None, text=OWN):
    cells = [("triangle", SLAB), ("line", COLUMNS)] if cells is None else cells
    data = [np.full(len(c), 1 + (kind == "line")) for kind, c in cells] if data is None else data
    meshio.Mesh(points, cells, cell_data={"part": data}).write(folder / "own.vtu")
    path = folder / "own.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_triangles_and_lines_make_a_building(tmp_path):
    mesh = mesh_building(load_building(write(tmp_path)))
    model = mesh.model
    assert (
        len(model.elements_of(Triangles)),
        len(model.elements_of(Beams)),
        len(model.elements_of(Shells)),
    ) == (4, 4, 0)
    assert set(model.elements_of(Triangles).kind) == {"slab"}
    assert set(model.elements_of(Beams).kind) == {"column"}
    np.testing.assert_array_equal(model.elements_of(Beams).up, np.tile([0, 1, 0], (4, 1)))
    weight = 2400.0 * (5 * 4 * 0.2 + 4 * 3 * 0.3 * 0.4)
    assert self_mass(model, []).sum() == pytest.approx(weight, rel=1e-12)
    assert model.fixed[mesh.base_nodes].all()
    assert len(mesh.base_nodes) == 4
    # Four clamped columns under a slab much stiffer than they are: 12 E I / h^3 each along x, and
    # the slab with 13 / 35 of the columns as the mass. 3 %: the slab bends a little.
    inertia, mass = 0.4 * 0.3**3 / 12, 2400.0 * (4.0 + 13 / 35 * 1.44)
    # Rotation of the slab's corners softens the columns: between hinged and clamped heads.
    low, high = (np.sqrt(4 * k * 30e9 * inertia / 27 / mass) / 2 / np.pi for k in (3, 12))
    assert low < frequencies(mesh, 1)[0] < high


def test_the_study_keeps_the_mesh_beside_the_building(tmp_path):
    building = load_building(write(tmp_path))
    again = load_building(save_building(building, tmp_path / "study" / "building.toml"))
    assert {p.name for p in (tmp_path / "study").iterdir()} == {
        "building.toml",
        "building_mesh.vtu",
    }
    assert mechanics_hash(again) == mechanics_hash(building)
    write(tmp_path, points=POINTS * [1.0, 1.01, 1.0])
    assert mechanics_hash(load_building(tmp_path / "own.toml")) != mechanics_hash(again)


ABAQUS = """*HEADING
table
*NODE
{nodes}
*ELEMENT, TYPE=S3, ELSET=SLAB
{slab}
*ELEMENT, TYPE=B31, ELSET=COLUMNS
{columns}
"""

GMSH_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
1 2 "COLUMNS"
2 1 "SLAB"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 5 4 3 1 2 0
1 0 0 3 5 4 3 1 1 0
$EndEntities
$Nodes
1 9 1 9
2 1 0 9
1
2
3
4
5
6
7
8
9
{points}
$EndNodes
$Elements
2 8 1 8
1 1 1 4
{columns}
2 1 2 4
{slab}
$EndElements
"""


def rows(table, first=1, between=", "):
    return "\n".join(
        between.join(map(str, [n, *(np.asarray(row) + 1)])) for n, row in enumerate(table, first)
    )


@pytest.mark.parametrize("ending", ["inp", "msh"])
def test_groups_by_name_in_files_of_other_programs(tmp_path, ending):
    plain = frequencies(mesh_building(load_building(write(tmp_path))))
    if ending == "inp":
        nodes = "\n".join(f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(POINTS, 1))
        text = ABAQUS.format(nodes=nodes, slab=rows(SLAB), columns=rows(COLUMNS, 5))
    else:
        points = "\n".join(" ".join(map(str, p)) for p in POINTS)
        slab, columns = rows(SLAB, 5, " "), rows(COLUMNS, 1, " ")
        text = GMSH_4.format(points=points, slab=slab, columns=columns)
    (tmp_path / f"own.{ending}").write_text(text, encoding="utf-8")
    own = OWN.replace("own.vtu", f"own.{ending}").replace('tags = "part"\n', "")
    own = own.replace('group = "1"', 'group = "SLAB"').replace('group = "2"', 'group = "COLUMNS"')
    path = tmp_path / "named.toml"
    path.write_text(own, encoding="utf-8")
    np.testing.assert_allclose(frequencies(mesh_building(load_building(path))), plain, rtol=1e-9)


def refused(path, message):
    with pytest.raises(BuildingError, match=message) as error:
        load_building(path)
    assert re.search(r"own\.toml: \w", str(error.value))


def test_a_flat_element_is_named(tmp_path):
    points = POINTS.copy()
    points[8] = [2.5, 0.0, 3.0]
    cells = [("triangle", SLAB), ("line", COLUMNS)]
    refused(
        write(tmp_path, points, cells), r"mesh\.file: triangle 0 \(nodes 4, 5, 8\) at .* no area"
    )


def test_double_nodes_are_found_and_merged(tmp_path):
    points = np.concatenate([POINTS, POINTS[4:5]])
    columns = COLUMNS.copy()
    columns[0, 1] = 9
    cells = [("triangle", SLAB), ("line", columns)]
    path = write(tmp_path, points, cells)
    refused(path, r"mesh\.file: 1 pairs of nodes .* nodes 4 and 9 at \(0, 0, 3\) m")
    plain = frequencies(mesh_building(load_building(write(tmp_path))))
    text = OWN.replace('unit = "m"', 'unit = "m"\nmerge = "1 mm"')
    merged = mesh_building(load_building(write(tmp_path, points, cells, text=text)))
    np.testing.assert_allclose(frequencies(merged), plain, rtol=1e-9)
    meant = OWN.replace('unit = "m"', 'unit = "m"\nmerge = "0 m"')
    apart = mesh_building(load_building(write(tmp_path, points, cells, text=meant)))
    assert frequencies(apart, 1)[0] < plain[0]


def test_a_piece_that_is_not_connected_is_told(tmp_path):
    points = np.concatenate([POINTS, [[8.0, 0, 3], [9, 0, 3], [9, 1, 3]]])
    cells = [("triangle", np.concatenate([SLAB, [[9, 10, 11]]])), ("line", COLUMNS)]
    refused(
        write(tmp_path, points, cells), r"1 piece is not connected to the base, such as 3 nodes"
    )


def test_a_node_on_the_side_of_an_element_is_told(tmp_path):
    """The wall's edge has a node in the middle that the column beside it has not."""
    points = np.concatenate([POINTS, [[2.5, 0.0, 3.0], [2.5, -2.0, 3.0]]])
    more = np.array([[4, 9, 10], [9, 5, 10]])
    cells = [("triangle", np.concatenate([SLAB, more])), ("line", COLUMNS)]
    refused(write(tmp_path, points, cells), r"node 9 at \(2\.5, 0, 3\) m lies on the side between")


def test_cells_of_another_type_are_told(tmp_path):
    solid = np.array([[0, 1, 2, 4]])
    refused(
        write(tmp_path, cells=[("tetra", solid), ("line", COLUMNS)]),
        r"it holds 1 cells of type 'tetra', which have no element here; leave them out",
    )
    curved = np.array([[4, 5, 7, 6, 8, 8]])
    refused(
        write(tmp_path, cells=[("triangle6", curved), ("line", COLUMNS)]),
        r"type 'triangle6'.*first-order elements \(\"triangle\"\)",
    )


WRONG = {
    "no such file": ("own.vtu", "other.vtu", r"mesh\.file: there is no file .*other\.vtu"),
    "a device": ("own.vtu", "/dev/zero", r"mesh\.file: there is no file /dev/zero"),
    "name too long": ("own.vtu", f"{'o' * 300}.vtu", r"mesh\.file: there is no file .*ooo\.vtu"),
    "no such tags": ('tags = "part"', 'tags = "story"',
        r"mesh\.tags: .* no cell data 'story'.*part"),
    "no such group": ('group = "2"', 'group = "3"', r"parts\[1\]\.group: no group .* '3' \(known"),
    "group twice": ('group = "2"\nsection', 'group = "1"\nsection', r"parts\[1\]\.group: no lines"),
    "a group without a part": ('[[parts]]\ngroup = "1"\nthickness = "200 mm"\n', "",
        r"parts: 4 triangle cells belong to no part, such as the one at .* in group '1'"),
    "wrong unit": ('unit = "m"', 'unit = "mm"', r"stories: no node .* level of RF, 3 m|mesh\."),
    "wrong height": ('"3 m"', '"3.2 m"', r"stories: no node .* 3\.2 m \(the nearest is 3 m\)"),
    "too low": ('height = "3 m"', 'height = "2 m"', r"stories: cells at .* outside the stories"),
    "wrong base": ('unit = "m"', 'unit = "m"\nbase = "1 m"', r"mesh\.base: no node lies at the"),
    "thickness and section": ('section = "column"\n\n[sensors]',
        'section = "column"\nthickness = "1 m"\n\n[sensors]',
        r"parts\[1\]\.thickness: give a thickness .* or a section"),
    "kind that does not fit": ('thickness = "200 mm"', 'thickness = "200 mm"\nkind = "column"',
        r"parts\[0\]\.kind: 'column' does not fit shells"),
    "unknown story": ('thickness = "200 mm"', 'thickness = "200 mm"\nstory = "S2"',
        r"parts\[0\]\.story: no story is named 'S2'"),
    "no sensor": ('[["0 m", "0 m"]]', "[]", r"sensors\.points: the list is empty"),
    "unknown key": ("[[parts]]", "[[parts]]\nthick = 1", r"parts\[0\]\.thick: unknown key"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), WRONG.values(), ids=WRONG)
def test_every_wrong_entry_is_told(tmp_path, old, new, message):
    assert old in OWN
    refused(write(tmp_path, text=OWN.replace(old, new, 1)), message)


def test_a_file_that_is_no_mesh(tmp_path, capsys):
    path = write(tmp_path)
    (tmp_path / "own.vtu").write_text("not a mesh", encoding="utf-8")
    refused(path, r"mesh\.file: own\.vtu cannot be read .*gmsh 2\.2 or 4\.1")
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    "line",
    ['hinges = "both"', 'rigid_ends = ["1 m", "0 m"]', 'eccentricity = ["1 m", "0 m", "0 m"]'],
)
def test_ends_of_shells_are_refused(tmp_path, line):
    text = OWN.replace('thickness = "200 mm"', f'thickness = "200 mm"\n{line}')
    name = line.split()[0]
    refused(write(tmp_path, text=text), rf"parts\[0\]\.{name}: it is for beams, and these cells")
