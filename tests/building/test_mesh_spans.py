"""Hinges, eccentric axes and rigid ends in a user's own mesh, against closed forms."""

from dataclasses import replace

import meshio
import numpy as np
import pytest

from femupdate.building import from_document, mesh_building
from femupdate.errors import BuildingError
from femupdate.fe import assemble, static_displacement

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
