"""Fits against the truth, over many noises."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import chi2

from femupdate.discrepancy.fit import extended, fit, fit_baseline
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, place, pose

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
GRID = np.linspace(0.4, 14.0, 60)
TRUTH, ZETA, GAIN = np.array([0.8, 1.4, 1.1]), 0.05, 0.02


CHAIN = Chain(MASSES, TRUTH * SPRINGS, zeta=ZETA)


def test_errors_are_as_large_as_their_standard_deviations():
    """Theta, zeta and a gain over 40 noises: mean and spread of the errors in their own sd."""
    frf = CHAIN.frf(GRID)
    frf[1] *= 1.0 + GAIN
    errors = []
    for seed in range(40):
        problem = pose(
            building_of(MASSES, SPRINGS), observe(("2F", "3F", "RF"), GRID, frf, 0.1, seed)
        )
        placed = place("channel_gain@3F")
        start = torch.from_numpy(np.append(np.log([*TRUTH, ZETA]), 0.0))
        found = fit(problem, placed, start)
        theta, sd = found.theta()
        (gain,), (gain_sd,) = found.sizes()
        ln_zeta_sd = found.covariance().diagonal()[3].sqrt()
        errors.append(
            [
                *(theta - TRUTH) / sd,
                np.log(found.zeta / ZETA) / float(ln_zeta_sd),
                (gain - GAIN) / gain_sd,
            ]
        )
    errors = np.array(errors)
    count = len(errors)
    # The prior of the gain (0 ± 0.05) pulls by a tenth of an sd.
    assert np.abs(errors.mean(axis=0)).max() < 4.0 / np.sqrt(count)
    spread = (errors**2).sum() / chi2.ppf([0.0005, 0.9995], errors.size)
    assert spread[1] < 1.0 < spread[0]


def test_the_baseline_is_found_from_anywhere_in_the_prior():
    """Without noise the truth comes out, whatever the seed of the draws."""
    exact = observe(("2F", "3F", "RF"), GRID, CHAIN.frf(GRID), 1e-9, 0)
    exact = replace(exact, noise_sd=np.full_like(exact.noise_sd, 0.05))
    problem = pose(building_of(MASSES, SPRINGS), exact)
    for seed in (0, 7):
        best, *others = fit_baseline(problem, seed=seed)
        np.testing.assert_allclose(best.theta()[0], TRUTH, rtol=1e-3)
        assert best.zeta == pytest.approx(ZETA, rel=1e-2)
        objectives = [one.chi2 + one.penalty for one in (best, *others)]
        assert objectives == sorted(objectives)


@pytest.mark.parametrize("seed", [6, 7])
def test_a_search_that_ends_beside_the_maximum_is_done_again(seed):
    """Of 24 draws those of seed 7 lead to 3.00 for the last factor; further ones do not."""
    truth, zeta = np.array([0.52, 1.025, 1.01, 0.906]), 0.008
    masses, springs, grid = np.full(4, 1000.0), np.full(4, 4e6), np.arange(1, 257) * 0.05
    floors = ("2F", "3F", "4F", "RF")
    frf = Chain(masses, truth * springs, zeta=zeta).frf(grid)
    prior = {"theta": {"lower": 0.33, "upper": 3.0}, "zeta": {"lower": 0.002, "upper": 0.06}}
    problem = pose(building_of(masses, springs, prior=prior), observe(floors, grid, frf, 0.01, 0))
    best = fit_baseline(problem, seed=seed, samples=24, starts=3)[0]
    np.testing.assert_allclose(best.theta()[0], truth, rtol=2e-3)


def test_an_extended_model_starts_where_the_smaller_one_stands():
    """With neutral sizes it predicts the same, and its fit is not worse."""
    problem = pose(
        building_of(MASSES, SPRINGS), observe(("2F", "3F", "RF"), GRID, CHAIN.frf(GRID), 0.1, 1)
    )
    base = fit_baseline(problem)[0]
    placed = place("story_damper@3F", "tuned_appendage@RF")
    z = extended(problem, base, placed, np.array([0.0, 0.0, 1.0, 0.02]))
    assert problem.with_effects(placed).prior.steps.size == len(z) == 3 + 1 + 4
    more = fit(problem, placed, z, iterations=0)
    np.testing.assert_allclose(more.residual, base.residual, atol=1e-8)
    assert fit(problem, placed, z).chi2 <= base.chi2 + 1e-6
