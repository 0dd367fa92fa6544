"""Channels under wrong names, which draw theta far off: found from the whole prior, and cheaply.

The data are FRFs of a five-story chain, solved frequency by frequency, with an error of 5 % on |H|
and the phase.
"""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.discrepancy.exchange import exchange_fits, promising
from femupdate.discrepancy.fit import error_left, extended, fit, fit_baseline
from femupdate.discrepancy.repair import repair
from femupdate.discrepancy.residual_map import p_value
from femupdate.discrepancy.score import candidates
from femupdate.discrepancy.thresholds import SEARCH
from femupdate.dynamics.reduced import ReducedStructure
from femupdate.dynamics.system import System

GRID = 0.2 * np.arange(1, 61)
FLOORS = ("2F", "3F", "4F", "5F", "RF")
THETA, SD = np.array([0.7, 1.4, 0.9, 1.6, 0.6]), 0.05
MASSES, SPRINGS = np.ones(5), np.full(5, 600.0)


@pytest.fixture(scope="module")
def hidden(chains, building_of, observe, pose):
    """A function: the problem with the rows in an order and with signs, and its best fit."""

    def make(rows=(0, 1, 2, 3, 4), signs=(1, 1, 1, 1, 1), masses=MASSES, quiet=1.0):
        chain = chains.Chain(masses, SPRINGS * THETA, zeta=0.03)
        frf = chain.frf(GRID)[list(rows)] * np.array(signs)[:, None]
        seen = observe(FLOORS, GRID, frf, SD / quiet, 5)
        seen = replace(seen, noise_sd=quiet * seen.noise_sd)
        problem = pose(building_of(MASSES, SPRINGS), seen)
        return problem, fit_baseline(problem)[0]

    return make


def exchanges(problem):
    return [one for one in candidates(problem) if one.exchange]


def for_searching(reduced):
    """The structure as the prior's own basis knows it: no effect can act on its shapes."""
    basis = np.zeros((len(reduced.basis), 0))
    model = replace(reduced.model, rotation=None)
    return ReducedStructure(reduced.structure, model, basis)


WRONG = {
    "swapped_channels@2F,3F": {"rows": (1, 0, 2, 3, 4)},
    "swapped_channels@4F,RF": {"rows": (0, 1, 4, 3, 2)},
    "reversed_channel@3F": {"signs": (1, -1, 1, 1, 1)},
}


@pytest.mark.parametrize("label", WRONG)
def test_the_right_name_is_found_and_theta_with_it(hidden, label):
    problem, base = hidden(**WRONG[label])
    found = promising(problem, base, exchanges(problem))
    assert found[0].placed.label == label
    assert found[0].share < 0.1
    best = min(exchange_fits(problem, base, exchanges(problem)), key=lambda one: one.chi2)
    assert best.placed[-1].label == label
    theta, sd = best.theta()
    assert (np.abs(theta - THETA) < 4.0 * sd).all()
    # 600 numbers with errors of the stated size: within five standard deviations of chi2.
    assert best.chi2 < 600.0 + 5.0 * np.sqrt(1200.0)


def test_a_swap_has_drawn_theta_far_off(hidden):
    """Or else these tests would ask for nothing."""
    theta, sd = hidden(**WRONG["swapped_channels@2F,3F"])[1].theta()
    assert (np.abs(theta - THETA) / THETA).max() > 0.2
    assert (np.abs(theta - THETA) / sd).max() > 5.0


def test_nothing_is_promised_where_the_names_are_right(hidden):
    problem, base = hidden()
    assert promising(problem, base, exchanges(problem)) == []
    assert promising(problem, base, []) == []


def test_the_structure_answers_once_for_all_exchanges(hidden, monkeypatch):
    problem, base = hidden(**WRONG["swapped_channels@2F,3F"])
    asked = exchanges(problem)
    assert len(asked) == 15
    answer, rows = System.frf, []

    def counted(system, theta, *others):
        rows.append(len(theta))
        return answer(system, theta, *others)

    monkeypatch.setattr(System, "frf", counted)
    promising(problem, base, asked[:3])
    three = sum(rows)
    rows.clear()
    promising(problem, base, asked)
    # Three of them are fitted, whichever they are; fits of at most ten steps of ten responses.
    assert sum(rows) < three + 3 * 2 * 10 * 10
    assert sum(rows) < 384 + 7 * 10 * 10 + 10


def test_only_wrong_names_leave_enough_to_look_for_an_exchange_first(hidden):
    """A basis is made about the factors as they are where these leave little."""
    for wrong in WRONG.values():
        problem, base = hidden(**wrong)
        assert error_left(problem, base) > SEARCH.right
    problem, base = hidden()
    assert error_left(problem, base) == pytest.approx(SD, rel=0.1)
    assert error_left(problem, base) < SEARCH.right


def test_what_cannot_act_on_the_basis_for_searching_is_kept_as_it_was(hidden, place):
    """A mass that the model has already goes into the fit, not into the search."""
    masses = MASSES + np.array([0.0, 0.0, 0.3, 0.0, 0.0])
    problem, plain = hidden(**WRONG["swapped_channels@2F,3F"], masses=masses)
    mass = place("added_mass@4F")
    base = fit(problem, mass, extended(problem, plain, mass, [0.3]))
    searching = replace(problem, search=for_searching(problem.reduced))
    found = promising(searching, base, exchanges(problem))
    assert found[0].placed.label == "swapped_channels@2F,3F"
    assert found[0].z[-1] == base.z[-1]
    best = exchange_fits(searching, base, exchanges(problem))[0]
    assert best.sizes()[0][0] == pytest.approx(0.3, abs=4.0 * best.sizes()[1][0])
    theta, sd = best.theta()
    assert (np.abs(theta - THETA) < 4.0 * sd).all()


def test_the_repair_starts_anew_from_an_exchange(hidden):
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
    assert p_value(done.problem, done.after) > 0.001
    assert done.last.verdict == "none"


def test_a_repair_without_an_exchange_keeps_its_problem(hidden):
    masses = MASSES + np.array([0.0, 0.0, 0.3, 0.0, 0.0])
    problem, base = hidden(masses=masses)
    done = repair(problem, base, renewed=lambda *_: pytest.fail("nothing was exchanged"))
    assert done.rounds[0].finding.placed.label == "added_mass@4F"
    assert done.problem is problem


def test_a_quiet_record_does_not_hide_the_second_of_two(hidden):
    """What is left of the first lies within the error that every estimate is allowed."""
    masses = MASSES + np.array([0.0, 0.0, 0.06, 0.0, 0.0])
    problem, base = hidden(**WRONG["swapped_channels@2F,3F"], masses=masses, quiet=4.0)
    done = repair(problem, base)
    added = [one.finding.placed.label for one in done.rounds]
    assert added == ["swapped_channels@2F,3F", "added_mass@4F"]
    assert p_value(problem, done.rounds[0].finding.fitted) > 0.5
    assert done.last.verdict == "none"
