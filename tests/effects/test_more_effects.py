"""P-Delta, braces, drifting clocks and softening within a run, against equations by hand."""

import copy

import numpy as np
import pytest
from scipy.linalg import eigh

from femupdate.building import from_document
from femupdate.dynamics import equations_at
from femupdate.dynamics.equations import WithSprings
from femupdate.effects import CATALOGUE, structure_of
from femupdate.fe import factorize
from tests.documents import stick

ZETA = 0.03
HEIGHTS, MASSES = np.array([3.5, 3.0, 3.0]), np.array([40e3, 35e3, 30e3])
SPRINGS = np.array([6e6, 5e6, 4e6])
GRAVITY = 9.80665


def tower(heights=HEIGHTS):
    return structure_of(from_document(stick(MASSES, SPRINGS, heights)))


def agree(ours, exact):
    np.testing.assert_allclose(ours, exact, rtol=1e-7, atol=1e-9)


def test_gravity_takes_weight_over_height_from_every_story():
    structure, theta = tower(), np.array([0.8, 1.2, 1.0])
    weight = GRAVITY * np.cumsum(MASSES[::-1])[::-1]
    k = np.append(theta * SPRINGS - weight / HEIGHTS, 0.0)
    exact = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    terms = CATALOGUE["p_delta"].terms(structure, "all")
    equations = equations_at(structure, theta, [(terms, 1.0)])
    sprung = WithSprings(factorize(equations.stiffness), equations.springs)
    found = sprung.times(np.eye(3))
    np.testing.assert_allclose(found, exact, rtol=1e-12)
    np.testing.assert_allclose(sprung.apply(np.eye(3)), np.linalg.inv(exact), rtol=1e-12)
    plain = structure.stiffness(theta).toarray()
    squared = [eigh(one, np.diag(MASSES), eigvals_only=True) for one in (plain, found)]
    lost = 1.0 - np.sqrt(squared[1] / squared[0])
    assert lost[0] > 1.3 * lost[-1] > 0.0  # not a scaling of all frequencies alike


def test_a_brace_is_a_spring_between_floors(case):
    floors, size = case.structure.floors, 0.3
    pairs = [(0, 2), (1, 3)] if case.structure.is_stick else [(0, 1), (1, 2), (0, 2)]
    names = ("ground", *floors)
    assert {f"{names[low]}-{names[high]}" for low, high in pairs} <= set(
        CATALOGUE["brace"].places(case.structure)
    )
    means = case.equations.rows if case.equations.means is None else case.equations.means
    rows = np.vstack([np.zeros(means.shape[1]), means])
    ones = np.linalg.solve(
        case.structure.stiffness(np.ones(len(case.theta))).toarray(), case.equations.force[:, 0]
    )
    unit = case.equations.rigid_mass[0, 0] / (case.equations.rows[-1] @ ones)
    for low, high in pairs:
        stretch = rows[high] - rows[low]
        changed = case.equations.but(K=case.equations.K + size * unit * np.outer(stretch, stretch))
        ours = case.frf(f"brace@{names[low]}-{names[high]}", sizes=[size], zeta=ZETA)
        agree(ours, changed.frf(case.frequency_hz, ZETA))


@pytest.mark.parametrize("growth", [-0.15, 0.003, 0.12])
def test_a_drifting_clock_is_the_mean_over_its_delays(stick, growth):
    """Many delays, even from the beginning to the end of the record."""
    start, steps = 0.004, 20000
    delays = start + growth * (np.arange(steps) + 0.5) / steps
    turns = np.exp(-2j * np.pi * stick.frequency_hz[:, None] * delays).mean(axis=1)
    exact = stick.frf(zeta=ZETA)
    exact[2] *= turns
    ours = stick.frf("drifting_clock@4F", sizes=[growth, start], zeta=ZETA)
    np.testing.assert_allclose(ours, exact, rtol=1e-5, atol=1e-7)


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
