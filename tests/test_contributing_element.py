"""The element of CONTRIBUTING.md, put into the folder of elements, works everywhere."""

import json
import subprocess
import sys

import meshio
import numpy as np
import pytest

from femupdate.building import load_building, mesh_building
from femupdate.errors import BuildingError, StructureError
from femupdate.fe import (
    FiniteElementModel,
    PointMasses,
    assemble,
    element_kinds,
    lowest_modes,
    opensees_script,
    static_displacement,
)
from femupdate.fe import elements as folder
from tests.helpers import contribute

E, AREA, DENSITY, ONE = 200e9, 3e-4, 7850.0, np.ones(1)


@pytest.fixture
def kind(tmp_path, monkeypatch):
    """The page's element as a module beside the others."""
    contribute("A new element", folder, "tie", tmp_path, monkeypatch)
    element_kinds.cache_clear()
    yield element_kinds()["tie"]
    element_kinds.cache_clear()
    sys.modules.pop(f"{folder.__name__}.tie", None)


def truss(kind, points, nodes, free, **parts):
    """Ties between points that move as the flags (N, 3) say."""
    count = len(nodes)
    block = kind(
        nodes=np.array(nodes),
        area=np.full(count, AREA),
        youngs_modulus=np.full(count, E),
        density=np.full(count, DENSITY),
        group=np.zeros(count, dtype=np.int64),
        kind=np.full(count, "beam"),
    )
    fixed = np.ones((len(points), 6), dtype=bool)
    fixed[:, :3] = ~np.array(free)
    return FiniteElementModel(np.array(points), fixed, 1, (block,), **parts)


def test_tip_of_two_inclined_ties(kind):
    """Ties at +-alpha to the load: u = P L / (2 E A cos^2 alpha), N = P / (2 cos alpha)."""
    points = [[-1.5, 0.0, 2.0], [1.5, 0.0, 2.0], [0.0, 0.0, 0.0]]
    still = [False] * 3
    model = truss(kind, points, [[0, 2], [1, 2]], [still, still, [True, False, True]])
    load = np.zeros((3, 6))
    load[2, 2] = -5e3
    motion = static_displacement(assemble(model), ONE, load.ravel())
    length, cosine = 2.5, 0.8
    assert motion[14] == pytest.approx(-5e3 * length / (2 * E * AREA * cosine**2), rel=1e-12)
    ties = model.elements[0]
    moved = motion.reshape(-1, 6)[ties.nodes].reshape(2, -1)
    forces = np.einsum("nrd,nd->nr", ties.force_rows(model.nodes), moved)
    np.testing.assert_allclose(forces, 5e3 / (2 * cosine), rtol=1e-12)


def hung(kind, count=1):
    """A mass of 120 kg on a chain of ties, 3 m long."""
    points = np.column_stack([np.full((count + 1, 2), 0.4), np.linspace(3.0, 0.0, count + 1)])
    mass = PointMasses(np.array([count]), np.array([120.0]), np.zeros((1, 3)))
    free = np.outer(np.arange(count + 1) > 0, [False, False, True])
    nodes = [[k, k + 1] for k in range(count)]
    return truss(kind, points, nodes, free, masses=mass)


def test_frequency_of_a_mass_on_a_tie(kind):
    """K = E A / L; a third of the tie's own mass moves with the point mass."""
    found = lowest_modes(assemble(hung(kind)), ONE, 1).frequency_hz[0]
    exact = np.sqrt(E * AREA / 3.0 / (120.0 + DENSITY * AREA * 3.0 / 3.0)) / (2 * np.pi)
    assert found == pytest.approx(exact, rel=1e-12)


def test_opensees_finds_the_same_frequencies(kind, tmp_path):
    script = tmp_path / "model.py"
    script.write_text(opensees_script(hung(kind, 8), ONE, modes=3))
    done = subprocess.run([sys.executable, script, "--json"], capture_output=True, text=True)
    if "Failed to import openseespy" in done.stderr or "No module" in done.stderr:
        pytest.skip("OpenSeesPy cannot be imported")
    found = json.loads(done.stdout.strip().splitlines()[-1])["frequencies_hz"]
    ours = lowest_modes(assemble(hung(kind, 8)), ONE, 3).frequency_hz
    np.testing.assert_allclose(found, ours, rtol=1e-9)


def test_an_impossible_tie_is_named(kind):
    model = truss(kind, [[0.0, 0, 0], [0, 0, 0]], [[0, 1]], [[True] * 3, [True] * 3])
    with pytest.raises(StructureError, match=r"tie 0 \(nodes 0, 1\) has no length"):
        assemble(model)


TABLE = """
name = "braced"
kind = "mesh"
mesh = { file = "braced.vtu", unit = "m", tags = "part" }
stories = [{ name = "S1", height = "3 m" }]
sensors = { direction = "x", points = [["0 m", "0 m"]] }
frequency_grid = { start = "0.1 Hz", step = "0.1 Hz", count = 100 }
prior = { theta = { lower = 0.5, upper = 2 } }
damping = { law = "constant", ratio = 0.02 }

[materials.steel]
youngs_modulus = "200 GPa"
poisson_ratio = 0.3
density = "7850 kg/m3"

[sections]
column = { shape = "rectangle", width = "300 mm", depth = "300 mm", material = "steel" }
rod = { shape = "circle", diameter = "20 mm", material = "steel" }

[[parts]]
group = "1"
section = "column"

[[parts]]
group = "2"
section = "rod"
element = "ELEMENT"
"""


def braced(folder_, element, more=""):
    """Two columns and a beam with a diagonal, as a mesh and its building file."""
    points = np.array([[0.0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]])
    lines = np.array([[0, 3], [1, 2], [3, 2], [0, 2]])
    mesh = meshio.Mesh(points, [("line", lines)], cell_data={"part": [np.array([1, 1, 1, 2])]})
    meshio.write(folder_ / "braced.vtu", mesh)
    path = folder_ / "braced.toml"
    path.write_text(TABLE.replace("ELEMENT", element) + more)
    return load_building(path)


def test_a_part_of_an_own_mesh_becomes_ties(kind, tmp_path):
    model = mesh_building(braced(tmp_path, "tie")).model
    ties = model.elements_of(kind)
    assert [type(block).__name__ for block in model.elements] == ["Beams", "Ties"]
    np.testing.assert_array_equal(ties.nodes, [[0, 2]])
    np.testing.assert_allclose(ties.area, np.pi * 0.01**2, rtol=1e-12)
    rods = mesh_building(braced(tmp_path, "beam")).model
    with_ties, with_rods = (
        lowest_modes(assemble(one), ONE, 2).frequency_hz for one in (model, rods)
    )
    # Rods so slender hardly bend: they act as ties do.
    np.testing.assert_allclose(with_ties, with_rods, rtol=1e-3)


@pytest.mark.parametrize(
    ("element", "more", "message"),
    [
        ("truss", "", r"parts\[1\]\.element: no element named 'truss' .* beam, tie"),
        ("tie", 'hinges = "both"', r"parts\[1\]\.element: a tie has no .* hinges; remove"),
    ],
)
def test_what_a_part_cannot_become_is_told(kind, tmp_path, element, more, message):
    with pytest.raises(BuildingError, match=message):
        mesh_building(braced(tmp_path, element, more))
