"""Sizes are known no better than the model of an effect."""

import numpy as np
import pytest

from femupdate.discrepancy import Finding
from femupdate.discrepancy.fit import extended, fit, fit_baseline
from femupdate.effects import CATALOGUE, Placed
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, pose

GRID = 0.2 * np.arange(1, 61)
FLOORS, THETA, SD = ("2F", "3F", "RF"), np.array([0.7, 1.4, 0.9]), 0.02
MASSES, SPRINGS, SHARE = np.ones(3), np.full(3, 600.0), 0.2


class RoughMass(type(CATALOGUE["added_mass"])):
    """A mass that stands for something else."""

    own_error = 0.12


class RoughBrace(type(CATALOGUE["brace"])):
    """A brace that stands for something else, told as a share of the building's stiffness."""

    own_error = 0.12


MASS = CATALOGUE["added_mass"]


@pytest.mark.parametrize(
    ("share", "effect", "at"),
    [(0.0, MASS, "3F"), (0.12, RoughMass(), "3F"), (0.12, RoughBrace(), "2F-RF")],
)
def test_the_error_of_an_effect_s_own_model_is_part_of_its_size(share, effect, at):
    heavy = (Placed(effect, at),)
    frf = Chain(MASSES + np.array([0.0, SHARE, 0.0]), SPRINGS * THETA, zeta=0.03).frf(GRID)
    building, seen = building_of(MASSES, SPRINGS), observe(FLOORS, GRID, frf, SD, 5)
    problem = pose(building, seen)
    base = fit_baseline(problem)[0]
    fitted = fit(problem, heavy, extended(problem, base, heavy, [0.1]), 25)
    (size,), (sd,) = fitted.sizes()
    scale = effect.parameters[0].scale
    noise = float(fitted.covariance().diagonal()[-1]) ** 0.5 * scale
    assert sd == pytest.approx(np.hypot(noise, share * size), rel=1e-6)
    told = Finding(None, fitted, 0.0, None, None, size, sd).told
    assert told[1] >= share * abs(told[0])
