"""The model as it is, fitted before anything is added to it."""

import numpy as np

from femupdate.discrepancy.fit import fit, fit_baseline
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, pose


def test_no_row_of_errors_leads_to_a_better_fit():
    """A damper and a mass are missing: a fit and its likeliest row could hold each other."""
    masses, springs, grid = np.full(4, 2.0), np.full(4, 4e3), 0.1 * np.arange(1, 160)
    rng = np.random.default_rng(1)
    heavy = masses * (1.0 + (np.arange(4) == rng.integers(4)) * rng.uniform(0.2, 0.6))
    stiff = springs * np.exp(rng.uniform(-0.4, 0.4, 4))
    damped = (np.arange(4) == rng.integers(4)) * rng.uniform(5.0, 20.0)
    frf = Chain(heavy, stiff, zeta=0.01, dashpots=damped).frf(grid)
    seen = observe(("2F", "3F", "4F", "RF"), grid, frf, 0.01, 2)
    problem = pose(building_of(masses, springs, zeta=(0.003, 0.06)), seen)
    base = fit_baseline(problem)[0]
    rows = [(row,) for row in range(0, len(base.densities[0]), 15)]
    others = [fit(problem.at_row(row), (), base.z, 60) for row in rows]
    densities = [float(fitted.densities[0].logsumexp(0)) for fitted in (base, *others)]
    assert max(densities) < densities[0] + 0.5  # the priors are uniform
