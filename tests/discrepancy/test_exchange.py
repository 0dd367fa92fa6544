"""Channels under wrong names, which draw theta far off: found from the whole prior, and cheaply."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.discrepancy.fit import fit, fit_baseline
from femupdate.discrepancy.global_search import exchange_fits, promising
from femupdate.discrepancy.repair import repair
from femupdate.discrepancy.score import candidates
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, pose

GRID = 0.2 * np.arange(1, 61)
FLOORS = ("2F", "3F", "4F", "5F", "RF")
THETA, SD = np.array([0.7, 1.4, 0.9, 1.6, 0.6]), 0.05
MASSES, SPRINGS = np.ones(5), np.full(5, 600.0)


def hidden(rows=(0, 1, 2, 3, 4), signs=(1, 1, 1, 1, 1), masses=MASSES, quiet=1.0):
    """The problem with the rows in an order and with signs, and its best fit."""
    chain = Chain(masses, SPRINGS * THETA, zeta=0.03)
    frf = chain.frf(GRID)[list(rows)] * np.array(signs)[:, None]
    seen = observe(FLOORS, GRID, frf, SD / quiet, 5)
    seen = replace(seen, noise_sd=quiet * seen.noise_sd)
    problem = pose(building_of(MASSES, SPRINGS), seen)
    return problem, fit_baseline(problem)[0]


def exchanges(problem):
    return [one for one in candidates(problem) if one.exchange]


WRONG = {
    "swapped_channels@2F,3F": {"rows": (1, 0, 2, 3, 4)},
    "swapped_channels@4F,RF": {"rows": (0, 1, 4, 3, 2)},
    "reversed_channel@3F": {"signs": (1, -1, 1, 1, 1)},
}


@pytest.mark.parametrize("label", WRONG)
def test_the_right_name_is_found_and_theta_with_it(label):
    problem, base = hidden(**WRONG[label])
    found = promising(problem, base, exchanges(problem))
    share, placed, _ = found[0]
    assert placed.label == label
    assert share < 0.1
    best = min(exchange_fits(problem, base, exchanges(problem)), key=lambda one: one.chi2)
    assert best.placed[-1].label == label
    theta, sd = best.theta()
    assert (np.abs(theta - THETA) < 4.0 * sd).all()
    # 600 numbers with errors of the stated size: within five standard deviations of chi2.
    assert best.chi2 < 600.0 + 5.0 * np.sqrt(1200.0)


def test_the_repair_starts_anew_from_an_exchange():
    """What a basis about the wrong theta gave is not carried on."""
    problem, base = hidden(**WRONG["swapped_channels@2F,3F"])
    asked = []

    def renewed(now, fitted):
        asked.append((now, fitted.placed[-1].label))
        again = replace(now)
        return again, fit(again, fitted.placed, fitted.z)

    done = repair(problem, base, renewed=renewed)
    assert [one.finding.placed.label for one in done.rounds] == ["swapped_channels@2F,3F"]
    assert asked == [(problem, "swapped_channels@2F,3F")]
    assert done.problem is not problem
    assert done.after is not done.rounds[0].finding.fitted
    assert done.after.p_value > 0.001
    assert done.last.verdict == "none"
