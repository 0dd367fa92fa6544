"""Diagonals of frames: braces, and the struts of infills, by closed forms."""

import json
import subprocess
import sys

import numpy as np
import pytest

from femupdate.building import from_document, mesh_building
from femupdate.building.blocks import strut_width
from femupdate.effects import CATALOGUE, structure_of
from femupdate.errors import BuildingError
from femupdate.fe import Beams, assemble, lowest_modes, opensees_script, static_displacement
from tests.building.frames import make_document

WIDTH, HEIGHT, AREA = 4.0, 3.0, 2e-3
LENGTH, COSINE = np.hypot(WIDTH, HEIGHT), WIDTH / np.hypot(WIDTH, HEIGHT)
BAR = {
    "shape": "figures",
    "area": AREA,
    "shear_area_y": AREA,
    "shear_area_z": AREA,
    "inertia_y": 4e-7,
    "inertia_z": 4e-7,
    "torsion_constant": 8e-7,
}
# Frames that neither stretch nor resist sway.
SLENDER = {**BAR, "area": 50.0, "shear_area_y": 50.0, "shear_area_z": 50.0}


def document_with(braces, stories=1, slender=True):
    document = make_document([HEIGHT] * stories, ([WIDTH], [5.0]), 10.0)
    document["sections"]["brace"] = BAR
    if slender:
        document["sections"].update(column=SLENDER, beam=SLENDER)
        document["slabs"] = []
    document["braces"] = braces
    return document


def brace(**changes):
    return {"section": "brace", "along": "Y0", "from": "X0", "to": "X1", **changes}


def sway_stiffness(document):
    """Force in x at the top corner of frame Y0, over its displacement."""
    model = mesh_building(from_document(document)).model
    node = int(np.flatnonzero((np.abs(model.nodes - [0.0, 0.0, HEIGHT]) < 1e-9).all(axis=1))[0])
    load = np.zeros((len(model.nodes), 6))
    load[node, 0] = 1.0
    moved = static_displacement(assemble(model), np.ones(1), load.ravel())
    return 1.0 / moved[6 * node]


@pytest.mark.parametrize(
    ("changes", "count"),
    [
        ({}, 1),
        ({"shape": "down"}, 1),
        ({"from": "X1", "to": "X0"}, 1),
        ({"shape": "cross"}, 2),
        ({"ends": "rigid"}, 1),
    ],
    ids=["up", "down", "from the right", "cross", "rigid ends"],
)
def test_a_bay_sways_as_its_bars_stretch(changes, count):
    """E A cos^2 / L a brace; bending of the bars is a thousandth of it."""
    bare = sway_stiffness(document_with([]))
    braced = sway_stiffness(document_with([brace(**changes)]))
    assert braced - bare == pytest.approx(count * 25e9 * AREA * COSINE**2 / LENGTH, rel=2e-3)


@pytest.mark.parametrize(
    ("changes", "ends"),
    [
        ({}, [((0.0, 3.0), (4.0, 6.0))]),
        ({"shape": "down"}, [((0.0, 6.0), (4.0, 3.0))]),
        ({"from": "X1", "to": "X0"}, [((4.0, 3.0), (0.0, 6.0))]),
        ({"shape": "cross"}, [((0.0, 3.0), (4.0, 6.0)), ((0.0, 6.0), (4.0, 3.0))]),
    ],
    ids=["up", "down", "from the right", "cross"],
)
def test_braces_run_where_the_file_says(changes, ends):
    document = document_with([brace(stories="S2", **changes)], 2, slender=False)
    model = mesh_building(from_document(document)).model
    beams = model.elements_of(Beams)
    own = beams.taken(np.flatnonzero(beams.kind == "brace"))
    assert own.group.tolist() == [1] * len(ends)
    found = model.nodes[own.nodes]
    np.testing.assert_allclose(found[:, :, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(found[:, :, [0, 2]], ends, atol=1e-12)
    assert own.released[:, [4, 5, 10, 11]].all()


def test_a_list_of_lines_is_one_entry_for_each():
    listed = document_with([brace(along=["Y0", "Y1"])], slender=False)
    single = document_with([brace(), brace(along="Y1")], slender=False)
    assert from_document(listed).braces == from_document(single).braces


def test_a_brace_that_ends_in_the_air_is_named():
    document = document_with([brace()], slender=False)
    document["columns"] = [{"section": "column", "at": ["X0-Y0", "X0-Y1"]}]
    document["beams"], document["slabs"] = [{"section": "beam", "along": "X0"}], []
    with pytest.raises(BuildingError, match=r"braces\[0\]: nothing but the brace is at \(4,"):
        mesh_building(from_document(document))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"section": "none"}, "braces[0].section"),
        ({"along": "Z"}, "braces[0].along"),
        ({"to": "X0"}, "braces[0]"),
        ({"stories": "S9"}, "braces[0].stories"),
        ({"shape": "chevron"}, "braces[0].shape"),
    ],
)
def test_wrong_braces_are_named(changes, words):
    document = document_with([brace(**changes)], slender=False)
    with pytest.raises(BuildingError) as caught:
        from_document(document)
    assert words in str(caught.value)


STORY, BAY = 3.2, 4.0
MASONRY = {"youngs_modulus": 3e9, "poisson_ratio": 0.2, "density": 1800.0}
CLEAR = STORY - 0.4, BAY - 0.3  # under a beam .4 m deep, between columns .3 m wide


@pytest.fixture
def document():
    """Two bays by one without slabs, an infill in the first bay of Y0."""
    document = make_document([STORY], ([BAY, 3.0], [5.0]), 10.0)
    document["materials"]["masonry"] = MASONRY
    document["sections"] = {
        "column": {"shape": "rectangle", "width": 0.3, "depth": 0.5, "material": "concrete"},
        "beam": {"shape": "rectangle", "width": 0.25, "depth": 0.4, "material": "concrete"},
    }
    document["slabs"] = []
    bay = {"along": "Y0", "from": "X0", "to": "X1", "thickness": 0.2, "material": "masonry"}
    document["infills"] = [bay | {"formula": "FEMA 356"}]
    return document


@pytest.mark.parametrize(
    ("formula", "width"),
    # lambda = (3e9 .2 sin 74.2 deg / (4 25e9 .001125 2.8))^.25 = 1.1636 1/m, r = 4.640 m:
    # .175 (1.1636 3.2)^-.4 4.640 = .4799 m; .15 4.640 = .6960 m.
    [("FEMA 356", 0.47993), ("EN 1998-1", 0.69601)],
)
def test_width_and_stiffness_by_hand(document, formula, width):
    ratio = 3e9 * 0.2 / (25e9 * 0.5 * 0.3**3 / 12)
    found = strut_width(formula, *CLEAR, column_height=STORY, stiffness_ratio=ratio)
    assert found == pytest.approx(width, rel=1e-4)
    document["infills"][0]["formula"] = formula
    mesh = mesh_building(from_document(document))
    assert mesh.notes == (
        f"infills[0]: strut {width:.3g} m wide by {formula}, half of it along each diagonal of 1 "
        "bay.",
    )
    beams = mesh.model.elements_of(Beams)
    struts = beams.taken(np.flatnonzero(beams.kind == "infill"))
    np.testing.assert_allclose(struts.area, 0.5 * 0.2 * width, rtol=1e-4)
    assert struts.mass(mesh.model.nodes).sum() == pytest.approx(1800 * 0.2 * CLEAR[0] * CLEAR[1])
    stiff = {"shape": "figures", "area": 50.0, "shear_area_y": 50.0, "shear_area_z": 50.0}
    slender = stiff | {"inertia_y": 4e-7, "inertia_z": 4e-7, "torsion_constant": 8e-7}
    slender |= {"material": "concrete"}
    document["sections"] = {"column": slender, "beam": slender}
    infilled = mesh_building(from_document(document))
    own = infilled.model.elements_of(Beams)
    area = own.area[own.kind == "infill"].sum()
    length = np.hypot(BAY, STORY)
    expected = 3e9 * area / length * (BAY / length) ** 2
    bare = mesh_building(from_document(document | {"infills": []}))
    assert _sway(infilled) - _sway(bare) == pytest.approx(expected, rel=2e-3)


def _sway(mesh):
    """Force along x at the head of the column X0-Y0, over its displacement."""
    nodes = mesh.model.nodes
    (top,) = np.flatnonzero((np.abs(nodes - [0.0, 0.0, STORY]) < 1e-9).all(axis=1))
    load = np.zeros((len(nodes), 6))
    load[top, 0] = 1.0
    return 1.0 / static_displacement(assemble(mesh.model), np.ones(1), load.ravel())[6 * top]


def test_opensees_finds_the_same_frequencies_by_trusses(document, opensees, tmp_path):
    document["infills"].append(document["infills"][0] | {"along": "X0", "from": "Y0", "to": "Y1"})
    document["columns"][0]["rigid_ends"] = [0.1, 0.35]
    document["columns"][0]["eccentricity"] = [0.05, 0.0]
    model = mesh_building(from_document(document)).model
    path = tmp_path / "model.py"
    path.write_text(opensees_script(model, np.ones(1)), encoding="utf-8")
    command = [sys.executable, str(path), "--json", "--modes", "5"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    theirs = json.loads(done.stdout.strip().splitlines()[-1])["frequencies_hz"]
    ours = lowest_modes(assemble(model), np.ones(1), 5).frequency_hz
    np.testing.assert_allclose(theirs, ours, rtol=5e-4)  # its beams have no rotary inertia


def test_their_stiffness_is_an_effect(document):
    structure = structure_of(from_document(document))
    ((_, more, _),) = CATALOGUE["infill_stiffness"].terms(structure, "S1").stiffness
    bare = structure_of(from_document(document | {"infills": []}))
    whole = structure.stiffness(np.ones(1)) - bare.stiffness(np.ones(1))
    assert abs(more - whole).max() < 1e-9 * abs(whole).max()


def test_a_cantilever_column_with_rigid_ends_by_hand():
    """The head moves by bending and shear of what lies between, and turns on the rigid head."""
    foot, head, load = 0.3, 0.5, 1e4
    document = make_document([STORY], ([BAY], [5.0]), 10.0)
    document["slabs"] = []
    document["columns"] = [{"section": "column", "rigid_ends": [foot, head]}]
    document["beams"] = [{"section": "beam", "hinges": "both"}]
    document["materials"]["concrete"]["youngs_modulus"] = 25e9
    for size in (10.0, 0.4):  # in one element, and in several
        document["mesh"]["size"] = size
        model = mesh_building(from_document(document)).model
        top = np.flatnonzero(
            np.isclose(model.nodes[:, 2], STORY)
            & np.isin(model.nodes[:, 0], [0.0, BAY])
            & np.isin(model.nodes[:, 1], [0.0, 5.0])
        )
        loads = np.zeros((len(model.nodes), 6))
        loads[top, 0] = load
        moved = static_displacement(assemble(model), np.full(1, 0.5), loads.ravel())
        soft, bending = STORY - foot - head, 0.5 * 25e9 * 0.6 * 0.4**3 / 12
        shear = 0.5 * 25e9 / 2.4 * 5 / 6 * 0.24
        bent = (soft**3 / 3 + soft**2 * head + soft * head**2) / bending
        # The rigid ends stay rigid at a factor of .5.
        np.testing.assert_allclose(moved.reshape(-1, 6)[top, 0], load * (bent + soft / shear))
