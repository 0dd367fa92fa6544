"""Braces of frame buildings, against what bars do by hand."""

import numpy as np
import pytest

from femupdate.building import from_document, mesh_building
from femupdate.errors import BuildingError
from femupdate.fe import Beams, assemble, static_displacement
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
