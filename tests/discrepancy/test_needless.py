"""Effects that those added later make needless go out of a repair again."""

from types import SimpleNamespace

import numpy as np
import pytest

from femupdate.discrepancy.fit import extended, fit, fit_baseline
from femupdate.discrepancy.repair import Round, _needed

GRID = 0.2 * np.arange(1, 61)
FLOORS = ("2F", "RF")
MASSES, SPRINGS, THETA = np.ones(2), np.full(2, 600.0), np.array([0.8, 1.2])


@pytest.fixture
def added(chains, building_of, observe, pose, place):
    """A function: the base, the fit with a gain of 2F and more mass on RF, and both rounds."""

    def run(gain):
        chain = chains.Chain(MASSES * [1.0, 1.25], SPRINGS * THETA, zeta=0.03)
        frf = chain.frf(GRID) * np.array([[1.0 + gain], [1.0]])
        problem = pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, frf, 0.03, 7))
        base = fit_baseline(problem)[0]
        placed = place("channel_gain@2F", "added_mass@RF")
        both = fit(problem, placed, extended(problem, base, placed, [0.02, 0.2]), 25)
        rounds = [
            Round(None, SimpleNamespace(placed=one), before, after)
            for one, before, after in zip(placed, (900.0, 700.0), (700.0, both.chi2), strict=True)
        ]
        return base, both, rounds

    return run


def test_what_is_within_two_standard_deviations_of_nothing_goes_out(added):
    base, both, rounds = added(0.0)
    after, kept = _needed(base, both, rounds)
    assert [one.label for one in after.placed] == ["added_mass@RF"]
    assert after.known[0] == pytest.approx(0.25, abs=0.03)
    (one,) = kept
    assert one.finding.placed.label == "added_mass@RF"
    # Squares are told from the model as it was, which the other round no longer begins from.
    assert (one.chi2_before, one.chi2_after) == (base.chi2, both.chi2)


def test_what_is_there_stays(added):
    base, both, rounds = added(0.2)
    after, kept = _needed(base, both, rounds)
    assert after is both
    assert kept == rounds
