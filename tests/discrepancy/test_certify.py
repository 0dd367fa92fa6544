"""Effects tested on data to which they were not fitted."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from femupdate.discrepancy import missed_in_turn
from femupdate.discrepancy.evidence import certify, gain_elsewhere, least_log_e_value
from femupdate.discrepancy.fit import extended, fit, fit_baseline
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, place, pose

GRID = 0.2 * np.arange(1, 61)
FLOORS, SD = ("2F", "RF"), 0.03
MASSES, SPRINGS, THETA = np.ones(2), np.full(2, 600.0), np.array([0.8, 1.2])


@given(
    st.lists(st.floats(-5.0, 12.0), min_size=1, max_size=12),
    st.integers(0, 20),
    st.sampled_from([0.01, 0.05, 0.2]),
)
def test_discoveries_are_those_of_the_rule_for_e_values(logs, untried, share):
    """The largest k whose k-th largest e-value is K / (k share) or more: so many are kept."""
    tried = len(logs) + untried
    values = np.sort(np.exp(logs))[::-1]
    enough = [k for k in range(1, len(logs) + 1) if values[k - 1] >= tried / (k * share)]
    least = least_log_e_value(sorted(logs, reverse=True), tried, share)
    kept = sum(one >= least for one in logs)
    assert kept >= max(enough, default=0)
    # One that lies below the threshold of the last discovery is none.
    assert kept == sum(np.exp(one) >= tried / (max(enough) * share) for one in logs if enough)


def posed(more, seed):
    """A problem in two halves, of a chain with more mass on its roof."""
    masses = MASSES * [1.0, 1.0 + more]
    frf = Chain(masses, SPRINGS * THETA, zeta=0.03).frf(GRID)
    whole, building = observe(FLOORS, GRID, frf, SD, seed), building_of(MASSES, SPRINGS)
    parity = np.arange(len(GRID)) % 2
    parts = [replace(whole, valid=whole.valid & (parity == one)) for one in (0, 1)]
    halves = tuple(pose(building, one).data[0] for one in parts)
    return in_parts(pose(building, whole), halves)


def in_parts(problem, halves):
    (data,) = problem.data
    return replace(problem, data=(replace(data, halves=halves),))


def weighed(problem, placed):
    base = fit_baseline(problem)[0]
    fitted = fit(problem, placed, extended(problem, base, placed, [0.05]), 25)
    return base, fitted, certify(problem, base, [fitted], 20, 0.05).get(placed[-1].label)


def test_mass_that_is_there_holds_on_the_other_half():
    found = weighed(posed(0.25, 1), place("added_mass@RF"))[2]
    assert found.log_e_value > np.log(20 / 0.05)
    assert found.certified


def test_what_is_not_there_gains_nothing_on_the_other_half():
    """Where theta acts nearly linearly the mean e-value is one, within its standard error here."""
    found = [weighed(posed(0.0, seed), place("added_mass@RF"))[2] for seed in range(10, 18)]
    values = np.exp([one.log_e_value for one in found])
    assert not any(one.certified for one in found)
    assert values.mean() < 1.0 + 3.0 * values.std(ddof=1) / len(values) ** 0.5
    assert np.log(values).mean() < 0.0


def test_data_that_cannot_be_parted_certify_nothing_and_are_not_kept_out_in_turn():
    base, _, tested = weighed(in_parts(posed(0.25, 1), ()), place("added_mass@RF"))
    assert tested is None
    assert np.isnan(missed_in_turn(base))


def test_other_data_weigh_an_effect_with_their_own_stiffness():
    """The other event's stories are 10 % softer: that speaks neither for the mass nor against."""
    placed, building = place("added_mass@RF"), building_of(MASSES, SPRINGS)
    base, fitted, _ = weighed(posed(0.25, 2), placed)
    gains = []
    for more in (0.25, 0.0):
        masses = MASSES * [1.0, 1.0 + more]
        frf = Chain(masses, 0.9 * SPRINGS * THETA, zeta=0.03).frf(GRID)
        other = pose(building, observe(FLOORS, GRID, frf, SD, 3))
        gains.append(gain_elsewhere(other, base, fitted))
    assert gains[0] > 5.0
    assert gains[1] < -5.0


def test_halves_kept_out_in_turn_are_missed_less_with_an_effect_that_is_there():
    base, fitted, _ = weighed(posed(0.25, 1), place("added_mass@RF"))
    before, after = missed_in_turn(base), missed_in_turn(fitted)
    assert 0.6 < after < 1.6
    assert before > 2.0 * after


def test_each_half_is_missed_by_no_less_than_a_fit_to_all_data_leaves():
    """The error is that of a prediction: the half was not fitted to."""
    fits = [weighed(posed(0.0, seed), place("added_mass@RF"))[1] for seed in range(3)]
    left = [one.chi2 / one.likelihood.effective for one in fits]
    assert np.mean([missed_in_turn(one) for one in fits]) > np.mean(left)
