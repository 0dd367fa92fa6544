"""Openings, joints, eccentric beams, rigid and sprung parts of frame buildings, checked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.building import (
    from_document,
    load_building,
    mechanics_hash,
    mesh_building,
    save_building,
    self_mass,
)
from femupdate.fe import Shells, assemble, lowest_modes, static_displacement
from femupdate.simulation import fine_model
from tests.building.frames import make_document


def meshed(document, size=None):
    return mesh_building(from_document(document), size)


def with_wall(openings=(), **changes):
    """A wall of 6 m x 3.5 m in plane y = 0 of a building of one story."""
    document = make_document([3.5], ([6.0], [5.0]), 0.5)
    wall = {"along": "Y0", "from": "X0", "to": "X1", "thickness": 0.3}
    document["walls"] = [{**wall, "openings": list(openings), **changes}]
    return document


DOOR = {"left": 1.3, "width": 0.9, "bottom": 0.0, "height": 2.1}
WINDOW = {"left": 3.25, "width": 1.6, "bottom": 0.85, "height": 1.2}


def wall_area(mesh):
    shells = mesh.model.elements_of(Shells)
    return shells.measure(mesh.model.nodes)[shells.kind == "wall"].sum()


def test_openings_are_where_the_file_says():
    mesh = meshed(with_wall([DOOR, WINDOW]))
    shells = mesh.model.elements_of(Shells)
    assert wall_area(mesh) == pytest.approx(6 * 3.5 - 0.9 * 2.1 - 1.6 * 1.2, rel=1e-12)
    corners = mesh.model.nodes[shells.nodes[shells.kind == "wall"]]
    middle = corners.mean(axis=1)
    for hole in (DOOR, WINDOW):
        x, z = middle[:, 0] - hole["left"], middle[:, 2] - hole["bottom"]
        assert not np.any((x > 0) & (x < hole["width"]) & (z > 0) & (z < hole["height"]))
    assert np.ptp(corners[:, :, [0, 2]], axis=1).max() <= 0.5 + 1e-9


def strip(size, **beam):
    """A cantilever floor strip: a slab 1 m wide on a beam along its middle line, held by a wall."""
    document = make_document([3.0], ([6.0], [0.5, 0.5]), size)
    document["columns"] = []
    document["beams"] = [{"section": "beam", "along": "Y1", **beam}]
    document["walls"] = [{"along": "X0", "from": "Y0", "to": "Y2", "thickness": 0.3}]
    model = meshed(document).model
    held = model.fixed.copy()
    held[np.isclose(model.nodes[:, 0], 0.0)] = True
    load = np.zeros((len(model.nodes), 6))
    tip = np.isclose(model.nodes[:, 0], 6.0)
    load[tip & np.isclose(model.nodes[:, 1], 0.5), 2] = 1e4
    operators = assemble(replace(model, fixed=held))
    moved = static_displacement(operators, np.ones(1), load.ravel()).reshape(-1, 6)
    return moved[tip, 2].mean()


def test_a_beam_under_the_slab_makes_a_t_section():
    """Slab 1 m x .15 m over a web .3 m x .5 m: E I of the composite section about its centroid."""
    found = strip(0.125, eccentricity=0.325)
    slab, web, gap = 0.15, 0.15, 0.325
    inertia = 1.0 * 0.15**3 / 12 + 0.3 * 0.5**3 / 12 + slab * web / (slab + web) * gap**2
    bending = 1e4 * 6.0**3 / 3 / 25e9 / inertia
    # 3 %: shear of the web (6 m over .65 m: 0.9 %) and shear lag of the slab, which only add.
    assert bending < found < 1.03 * bending
    assert strip(0.125) > 1.8 * found


def test_rigid_diaphragm_moves_as_one_body_in_plan():
    document = make_document([3.0, 3.0], ([5.0, 4.0], [6.0]), 1.5, 120e3)
    document["slabs"] = [
        {"x": ["X0", "X1"], "y": ["Y0", "Y1"], "thickness": 0.15, "diaphragm": "rigid"},
        {"x": ["X1", "X2"], "y": ["Y0", "Y1"], "thickness": 0.15, "diaphragm": "rigid"},
    ]
    model = meshed(document).model
    assert len(np.unique(model.links.master)) == 2  # the two slabs of a floor are one diaphragm
    operators = assemble(model)
    modes = lowest_modes(operators, np.ones(2), 6)
    shapes = operators.expand(modes.shapes).reshape(-1, 6, 6)
    for level in (3.0, 6.0):
        floor = np.isclose(model.nodes[:, 2], level)
        x, y = model.nodes[floor, :2].T
        for mode in range(6):
            spin = shapes[floor, 5, mode]
            assert np.ptp(spin) <= 1e-9 * np.abs(shapes[:, 5]).max()
            turned = shapes[floor, 0, mode] + y * spin
            assert np.ptp(turned) <= 1e-9 * np.abs(shapes[:, 0]).max()
            turned = shapes[floor, 1, mode] - x * spin
            assert np.ptp(turned) <= 1e-9 * np.abs(shapes[:, 1]).max()
    plain = {**document, "slabs": [{**s, "diaphragm": None} for s in document["slabs"]]}
    soft = lowest_modes(assemble(meshed(plain).model), np.ones(2), 6).frequency_hz
    assert (modes.frequency_hz >= soft - 1e-9).all()  # a constraint never lowers a frequency


def test_sprung_footing_against_two_springs_in_series():
    """A stiff tower on kx and kry: u = F / kx + F h^2 / kry at the height h of the force."""
    document = make_document([3.0], ([4.0], [4.0]), 2.0)
    document["walls"] = [
        {"along": line, "from": "Y0", "to": "Y1", "thickness": 0.5} for line in ("X0", "X1")
    ] + [{"along": line, "from": "X0", "to": "X1", "thickness": 0.5} for line in ("Y0", "Y1")]
    document["supports"] = {"base": "springs", "kx": 2e7, "kry": 3e8}
    mesh = meshed(document)
    model = mesh.model
    load = np.zeros((len(model.nodes), 6))
    roof = mesh.floor_nodes["RF"]
    roof = np.flatnonzero(np.isclose(model.nodes[:, 2], 3.0))
    load[roof, 0] = 1e4 / len(roof)
    moved = static_displacement(assemble(model), np.ones(1), load.ravel()).reshape(-1, 6)
    # The walls are some hundred times stiffer than the springs.
    assert moved[roof, 0].mean() == pytest.approx(1e4 / 2e7 + 1e4 * 9 / 3e8, rel=0.02)
    assert moved[-1, 4] == pytest.approx(1e4 * 3 / 3e8, rel=1e-9)
    assert moved[-1, 0] == pytest.approx(1e4 / 2e7, rel=1e-9)
    np.testing.assert_allclose(model.nodes[-1], [2.0, 2.0, 0.0])


def test_everything_together_keeps_its_mass_and_loads_back_equal(tmp_path):
    document = with_wall([DOOR, WINDOW])
    document["beams"] = [
        {"section": "beam", "along": ["X0", "X1"], "hinges": "end", "rigid_ends": [0.2, 0.0]},
        {"section": "tee", "along": ["Y1"], "eccentricity": 0.3},
    ]
    document["sections"]["tee"] = {
        "shape": "T",
        "width": 0.3,
        "depth": 0.6,
        "flange_width": 1.2,
        "flange_thickness": 0.15,
    }
    document["columns"] = [
        {"section": "column", "at": ["X0-Y1", "X1-Y1"], "eccentricity": [0.05, 0.0]},
        {"section": "column", "points": [[3.1, 2.4]]},
    ]
    document["slabs"][0]["diaphragm"] = "rigid"
    document["supports"] = {"base": "springs", "kx": 4e8, "kry": 3e9}
    building = from_document(document)
    mesh = mesh_building(building)
    operators = assemble(mesh.model)
    whole = operators.rigid_translation(0)
    total = whole @ operators.mass_full @ whole
    rigid = self_mass(mesh.model, []).sum()
    assert total == pytest.approx(rigid, rel=1e-9)
    again = load_building(save_building(building, tmp_path / "all.toml"))
    assert again == building
    assert mechanics_hash(again) == mechanics_hash(building)
    assert lowest_modes(operators, np.ones(1), 2).frequency_hz[0] > 0.5


def test_sensors_stand_at_any_point():
    """At a landing half-way up a column, and on the slab off the grid lines."""
    document = make_document([3.0, 3.0], ([6.0], [6.0]), 1.5)
    document["sensors"]["at"] = {"2F": [[0.0, 6.0, 1.4], [2.9, 3.1, 3.0]]}
    building = from_document(document)
    mesh = mesh_building(building)
    found = mesh.model.nodes[mesh.floor_nodes["2F"]]
    np.testing.assert_allclose(found, [[0.0, 6.0, 1.5], [3.0, 3.0, 3.0]])
    assert len(mesh.floor_nodes["RF"]) == 1
    fine = fine_model(building)
    assert [channel.name for channel in fine.channels[:2]] == ["2F:1.y", "2F:2.y"]
    assert fine.places[:2] == ("(0, 6, 1.4) m", "(2.9, 3.1, 3) m")
