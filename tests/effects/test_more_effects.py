"""P-Delta, braces, drifting clocks and softening within a run, against equations by hand."""

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
