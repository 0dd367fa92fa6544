"""Which further floor would tell two effects apart."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.discrepancy import DiagnosisSettings
from femupdate.discrepancy.diagnose import diagnose
from femupdate.discrepancy.fit import extended, fit, fit_baseline
from femupdate.discrepancy.further_measurements import PHASE, measurement_values
from femupdate.effects import CATALOGUE, Placed

GRID = 0.2 * np.arange(1, 61)
FLOORS = ("2F", "3F", "4F", "5F", "RF")
THETA, SD = np.array([0.7, 1.4, 0.9, 1.6, 0.6]), 0.05
MASSES, SPRINGS = np.ones(5), np.full(5, 600.0)
HEAVIER = MASSES + np.array([0.0, 0.0, 0.04, 0.0, 0.0])
FIRST, SECOND = (Placed(CATALOGUE["added_mass"], floor) for floor in ("4F", "5F"))


@pytest.fixture(scope="module")
def fitted(chains, building_of, observe, pose):
    """A function: the problem with some floors measured, free of error, and fits with effects."""

    def make(floors, placed, phase=True):
        frf = chains.Chain(HEAVIER, SPRINGS * THETA, zeta=0.03).frf(GRID)
        rows = [FLOORS.index(floor) for floor in floors]
        seen = observe(floors, GRID, frf[rows], 1e-9, 5, phase)
        seen = replace(seen, noise_sd=np.full(seen.noise_sd.shape, SD))
        problem = pose(building_of(MASSES, SPRINGS), seen)
        base = fit_baseline(problem)[0]
        found = [fit(problem, (one,), extended(problem, base, (one,), [0.1]), 40) for one in placed]
        return problem, found

    return make


@pytest.mark.parametrize("floors", [("2F", "RF"), ("2F", "3F"), ("5F", "RF")])
def test_what_a_floor_is_worth_is_what_its_data_then_bring(fitted, floors):
    """Half the chi-square by which the wrong effect misses once that floor is measured."""
    problem, (right, wrong) = fitted(floors, (FIRST, SECOND))
    worth = dict(measurement_values(problem, right, [wrong]))
    assert set(worth) == set(FLOORS) - set(floors)
    for floor, expected in worth.items():
        measured = [name for name in FLOORS if name in (*floors, floor)]
        _, (first, second) = fitted(measured, (FIRST, SECOND))
        gain = 0.5 * (second.chi2 + second.penalty - first.chi2 - first.penalty)
        assert expected == pytest.approx(gain, rel=0.05)  # the last steps are not taken


def test_the_phase_is_offered_where_it_was_not_measured(fitted):
    problem, (right, wrong) = fitted(FLOORS, (FIRST, SECOND), phase=False)
    assert [what for what, _ in measurement_values(problem, right, [wrong])] == [PHASE]
    problem, (right, wrong) = fitted(FLOORS, (FIRST, SECOND))
    assert measurement_values(problem, right, [wrong]) == ()


def test_a_diagnosis_says_what_would_decide(chains, building_of, observe, pose):
    """One floor of two: its gain and that of the base do the same to it."""
    chain = chains.Chain(np.ones(2), np.array([900.0, 700.0]), zeta=0.03)
    seen = observe(("RF",), GRID, 1.06 * chain.frf(GRID)[1:], 0.02, 3)
    found = diagnose(pose(building_of(np.ones(2), np.full(2, 800.0)), seen))
    labels = {found.leading.placed.label, *found.twins}
    assert found.verdict == "indistinguishable"
    assert {"base_gain@base", "channel_gain@RF"} <= labels
    said = " ".join(found.would_decide(DiagnosisSettings()))
    assert "2F" in said
    assert "base_gain@base is settled by two sensors side by side" in said
