"""Walls that only weigh, made stiff by an effect, against a mesh that has them."""

import copy

import numpy as np
import pytest

from femupdate.building import from_document
from femupdate.effects import CATALOGUE, structure_of

EFFECT = CATALOGUE["non_structural_walls"]


def stiff(document, number=1):
    """The document with one of its walls made stiff."""
    changed = copy.deepcopy(document)
    changed["walls"][number]["stiffness"] = True
    return changed


def two_lines(document):
    """A second wall that only weighs, on a line across the first, in the upper story alone."""
    changed = copy.deepcopy(document)
    changed["walls"].append(
        {
            "along": "A",
            "from": "P",
            "to": "Q",
            "thickness": 0.08,
            "role": "non_structural",
            "stories": ["high"],
        }
    )
    return changed


def condensed(structure, other, theta):
    """K (n, n) of another mesh on the nodes of a structure, statically, with dense matrices."""
    K = other.stiffness(theta).toarray()
    place = {tuple(np.round([*p, a], 6)): i for i, (p, a) in enumerate(_named(structure))}
    common = np.array([place.get(tuple(np.round([*p, a], 6)), -1) for p, a in _named(other)])
    kept, rest = np.flatnonzero(common >= 0), np.flatnonzero(common < 0)
    schur = K[np.ix_(kept, kept)]
    if len(rest):
        schur = schur - K[np.ix_(kept, rest)] @ np.linalg.solve(
            K[np.ix_(rest, rest)], K[np.ix_(rest, kept)]
        )
    result = np.zeros((len(kept),) * 2)
    result[np.ix_(common[kept], common[kept])] = schur
    return result


def _named(structure):
    return zip(structure.position, structure.axis, strict=True)


def added(structure, place, theta, size=1.0):
    terms = EFFECT.terms(structure, place).stiffness
    whole = structure.stiffness(theta)
    for story, matrix, _ in terms:
        whole = whole + size * theta[story] * matrix
    return whole.toarray()


@pytest.mark.parametrize("mesh_size", [5.0, 1.5])
def test_whole_walls_equal_a_mesh_with_them(frame_document, mesh_size):
    document = {**frame_document, "mesh": {"size": mesh_size}}
    structure = structure_of(from_document(document))
    other = structure_of(from_document(stiff(document)))
    theta = np.array([0.7, 1.6])
    exact = condensed(structure, other, theta)
    np.testing.assert_allclose(
        added(structure, "all", theta), exact, rtol=1e-9, atol=1e-9 * np.abs(exact).max()
    )


def test_an_opening_takes_stiffness_away(frame_document):
    document = {**frame_document, "mesh": {"size": 1.5}}
    holed = copy.deepcopy(document)
    holed["walls"][1]["openings"] = [{"left": 1.5, "width": 1.0, "bottom": 1.0, "height": 1.2}]
    theta = np.ones(2)
    structure = structure_of(from_document(holed))
    exact = condensed(structure, structure_of(from_document(stiff(holed))), theta)
    np.testing.assert_allclose(
        added(structure, "all", theta), exact, rtol=1e-9, atol=1e-9 * np.abs(exact).max()
    )


def test_places_of_two_lines(frame_document):
    structure = structure_of(from_document(two_lines(frame_document)))
    assert EFFECT.places(structure) == (
        *("all", "P", "A"),
        *("all/low", "all/high", "P/low", "P/high", "A/high"),
    )


def test_response_with_part_of_the_stiffness(frame):
    """Against the direct solution with the condensed matrix."""
    from_all = added(frame.structure, "all", frame.theta, 0.35)
    exact = frame.equations.but(K=from_all).frf(frame.frequency_hz, 0.03)
    ours = frame.frf("non_structural_walls@all", sizes=[0.35], zeta=0.03)
    np.testing.assert_allclose(ours, exact, rtol=2e-8)
