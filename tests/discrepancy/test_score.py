"""Score tests and p-values on data without any effect, and against what a refit gains."""

import numpy as np
import pytest
import torch
from scipy.stats import binomtest, kstest

from femupdate.discrepancy.fit import extended, fit, fit_baseline
from femupdate.discrepancy.score import (
    alike,
    candidates,
    same_to_sensors,
    score,
    unobservable_effects,
)
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, place, pose

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
GRID, FLOORS = np.linspace(0.4, 14.0, 60), ("2F", "3F", "RF")
TRUTH, ZETA, SD, CLEAN = np.array([0.8, 1.4, 1.1]), 0.05, 0.1, 60
TWO_SIDED = ("channel_gain@2F", "added_mass@3F", "channel_delay@RF")
ONE_SIDED = ("foundation_rocking@base", "story_damper@3F")


CHAIN = Chain(MASSES, TRUTH * SPRINGS, zeta=ZETA)


def fitted(frf, seed, sd=SD, phase=True):
    """The problem of an FRF with noise, and the model without effects fitted to it."""
    observation = observe(FLOORS, GRID, frf, sd, seed, phase)
    problem = pose(building_of(MASSES, SPRINGS), observation)
    start = torch.from_numpy(np.log([*TRUTH, ZETA]))
    return problem, fit(problem, (), start, 25)


@pytest.fixture(scope="module")
def clean():
    """Statistics (seed, effect) of clean data, and their p-values."""
    frf, placed = CHAIN.frf(GRID), place(*TWO_SIDED, *ONE_SIDED)
    statistics, tails = [], []
    for seed in range(CLEAN):
        problem, base = fitted(frf, seed)
        statistics.append([score(problem, base, one).statistic for one in placed])
        tails.append(base.p_value)
    return np.array(statistics), np.array(tails)


def test_statistics_of_clean_data_are_standard_normal(clean):
    statistics = clean[0][:, : len(TWO_SIDED)]
    # Mean within 4 / sqrt(n), standard deviation within 4 / sqrt(2 n), n = 60.
    assert np.abs(statistics.mean(axis=0)).max() < 4.0 / np.sqrt(CLEAN)
    assert np.abs(statistics.std(axis=0) - 1.0).max() < 4.0 / np.sqrt(2 * CLEAN)
    for column in statistics.T:
        assert kstest(column, "norm").pvalue > 1e-3


def test_an_impossible_sign_counts_for_nothing(clean):
    """Of an effect with a physical sign one half is zero, the rest half of a normal."""
    for column in clean[0][:, len(TWO_SIDED) :].T:
        zero = int((column == 0.0).sum())
        assert binomtest(zero, CLEAN).pvalue > 1e-3
        assert kstest(column[column != 0.0], "halfnorm").pvalue > 1e-3


def test_p_values_of_clean_data_are_uniform(clean):
    assert kstest(clean[1], "uniform").pvalue > 1e-3


def test_where_the_noise_is_alone_nothing_stands_out():
    _, base = fitted(CHAIN.frf(GRID), 5)
    cells = base.cells()
    assert len(cells) == 3 * 10
    assert min(cell.p_value for cell in cells) > 1e-3 / len(cells)
    inside = [cell for cell in cells if cell.excess != 0.0]
    assert np.mean([cell.excess for cell in inside]) == pytest.approx(0.0, abs=0.3)


def test_where_a_disturbed_band_of_one_floor_stands_out():
    frf = CHAIN.frf(GRID)
    band = (GRID > 8.0) & (GRID < 11.0)
    frf[1, band] *= 1.6
    _, base = fitted(frf, 5)
    worst = max(base.cells(), key=lambda cell: cell.excess)
    assert worst.floor == "3F"
    assert worst.band_hz[0] < 11.0
    assert worst.band_hz[1] > 8.0
    assert base.p_value < 1e-6


@pytest.mark.parametrize(
    ("label", "least", "change"),
    [
        ("channel_gain@3F", 0.95, lambda c: c.frf(GRID) * np.array([1, 1.02, 1])[:, None]),
        ("added_mass@2F", 0.75, lambda c: c.but(masses=MASSES * [1.02, 1, 1]).frf(GRID)),
        ("foundation_rocking@base", 0.75, lambda c: _rocking(c, 0.01).frf(GRID)),
        (
            "channel_delay@RF",
            0.95,
            lambda c: c.frf(GRID) * np.exp(-2j * np.pi * GRID * np.array([[0], [0], [4e-4]])),
        ),
    ],
)
def test_the_statistic_is_what_a_refit_gains(label, least, change):
    """Of a small effect: chi2 falls by the square of the score statistic (Rao, 1948)."""
    (placed,) = place(label)
    problem, base = fitted(change(CHAIN), 3, sd=0.01)
    test = score(problem, base, placed)
    start = extended(problem, base, (placed,), np.array([test.size]))
    after = fit(problem, (placed,), start, 30)
    gain = base.chi2 - after.chi2 - after.penalty
    assert abs(test.statistic) > 5.0
    # The test is made at half a prior sd (5 % of mass, of rocking): what theta would absorb of a
    # small effect has turned by then, which costs up to a quarter of the gain, and never adds.
    assert least * gain < test.statistic**2 < 1.02 * gain
    (size,), _ = after.sizes()
    assert 0.6 * size < test.size < 1.5 * size


def _rocking(chain, size):
    """Rocking that moves the roof by `size` of its own static displacement at theta = 1."""
    heights = np.arange(1.0, 4.0)
    roof = chain.but(springs=SPRINGS).static_roof
    moment = float((MASSES * heights).sum())
    # Damping proportional to stiffness would be the chain's only where it is nearly none.
    return chain.but(heights=heights, rocking=moment * heights[-1] / (size * roof))


def test_a_soft_base_is_absorbed_by_the_first_story():
    """Springs in series: no data of these sensors could show it, and none is left to explain."""
    problem, base = fitted(CHAIN.frf(GRID), 2, sd=0.02)
    tests = [score(problem, base, one) for one in candidates(problem)]
    assert unobservable_effects(problem, base, tests, 1.0) == ("base_sway@base",)


def test_a_weak_effect_is_hidden_by_large_noise():
    """A gain of 5 % under an error of 100 % of |H| in 60 points: D = .05 x sqrt(60) < 1."""
    problem, base = fitted(CHAIN.frf(GRID), 2, sd=1.0, phase=False)
    tests = [score(problem, base, one) for one in candidates(problem)]
    hidden = unobservable_effects(problem, base, tests, 1.0)
    assert {f"channel_gain@{floor}" for floor in FLOORS} <= set(hidden)


def test_candidates_are_what_the_sensors_could_show():
    frf = CHAIN.frf(GRID)
    some = observe(("3F", "RF"), GRID, frf[1:], SD, 0, phase=False)
    problem = pose(building_of(MASSES, SPRINGS), some)
    labels = {one.label for one in candidates(problem)}
    assert {"added_mass@2F", "channel_gain@RF", "swapped_channels@3F,RF"} <= labels
    assert "channel_gain@2F" not in labels  # no sensor there
    assert "swapped_channels@2F,3F" not in labels
    assert not any(one.startswith(("channel_delay", "reversed_channel")) for one in labels)
    assert not any(one.startswith("cracked_beams") for one in labels)  # a stick has none
    present = place("added_mass@2F")
    assert "added_mass@2F" not in {one.label for one in candidates(problem, present)}
    whole = pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, frf, SD, 0))
    assert "channel_delay@2F" in {one.label for one in candidates(whole)}


def test_effects_that_do_the_same_are_alike():
    """Of one floor alone its own gain and that of the base are one; a delay is another thing."""
    roof = observe(("RF",), GRID, CHAIN.frf(GRID)[2:], SD, 0)
    problem = pose(building_of(MASSES, SPRINGS), roof)
    base = fit(problem, (), torch.from_numpy(np.log([*TRUTH, ZETA])), 25)
    gain, own, delay = (
        score(problem, base, one)
        for one in place("base_gain@base", "channel_gain@RF", "channel_delay@RF")
    )
    assert alike(gain, own) == pytest.approx(1.0, abs=1e-3)
    assert alike(own, delay) < 0.5


def test_masses_of_two_floors_are_the_same_to_any_sensor():
    """Only m_1 / m_2 shows, theta takes the rest; a damper or a gain is another thing."""
    masses, springs = np.array([3.0, 2.0]), np.array([9e3, 5e3])
    frf = Chain(masses * [1.2, 1.0], springs * [0.8, 1.3], zeta=ZETA).frf(GRID)
    problem = pose(building_of(masses, springs), observe(("2F", "RF"), GRID, frf, 0.05, 0))
    base = fit_baseline(problem)[0]
    problem = base.likelihood
    low, high, damper, swapped = (
        score(problem, base, one)
        for one in place(
            "added_mass@2F", "added_mass@RF", "story_damper@RF", "swapped_channels@2F,RF"
        )
    )
    assert same_to_sensors(problem, base, [low, high], 0.97)
    assert not same_to_sensors(problem, base, [low, damper], 0.97)
    assert not same_to_sensors(problem, base, [low, high, damper], 0.97)
    assert not same_to_sensors(problem, base, [low, swapped], 0.97)
