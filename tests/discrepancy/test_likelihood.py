"""The likelihood of a model's parameters about its fit, and the check by it."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.discrepancy import likelihood_about, parameters_at
from femupdate.discrepancy.fit import fit_baseline
from femupdate.inference import predictive_check
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, pose

GRID = 0.1 * np.arange(1, 201)
FLOORS = ("2F", "3F", "RF")
MASSES, SPRINGS = np.ones(3), np.full(3, 900.0)


@pytest.mark.parametrize("more", [1.0, 1.25, 1.6])
def test_noise_of_any_size_is_allowed_for(more):
    """Tables by which fits are compared know once and twice the stated noise, nothing between."""
    frf = Chain(MASSES, SPRINGS, zeta=0.03).frf(GRID)
    seen = observe(FLOORS, GRID, frf, 0.05, 5)
    seen = replace(seen, noise_sd=seen.noise_sd / more)
    problem = pose(building_of(MASSES, SPRINGS), seen)
    likelihood = likelihood_about(fit_baseline(problem)[0])
    raw = likelihood.raw(parameters_at(fit_baseline(problem)[0]))
    names, squares, counts = zip(*likelihood.checked(raw, 1), strict=True)
    check = predictive_check(np.stack(squares, axis=1), np.stack(counts, axis=1), names)
    assert 0.01 < check.whole < 0.99
    assert check.ratios[0] ** 0.5 == pytest.approx(1.0, abs=0.1)
