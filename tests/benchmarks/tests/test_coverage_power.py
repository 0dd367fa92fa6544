"""The calibrating power, on Gaussian posteriors too wide or too narrow by a known factor."""

import numpy as np
import pytest
from femupdate.benchmarks.calibration.coverage_power import (
    SimulatedCase,
    fit_power,
    levels_at_power,
)
from scipy.stats import kstest


def cases(width, count=600, draws=500):
    """Posteriors of covariance width^2 times the right one, in two dimensions."""
    rng = np.random.default_rng(1)
    made = []
    for _ in range(count):
        mean = rng.normal(size=2)  # of the true posterior, of unit covariance
        truth = mean + rng.normal(size=2)
        points = mean + width * rng.normal(size=(draws, 2))
        values = [-0.5 * ((p - mean) ** 2).sum(-1) / width**2 for p in (points, truth)]
        made.append(SimulatedCase(values[0], float(values[1])))
    return made


@pytest.mark.parametrize("width", [0.8, 1.0, 1.4])
def test_the_power_is_the_ratio_of_variances(width):
    found = fit_power(cases(width))
    # Raising N(m, w^2) to the power b gives variance w^2 / b. 600 levels know it to 5 %.
    assert found.error < 0.1 * found.power
    assert found.power == pytest.approx(width**2, rel=0.15)
    assert kstest(found.level, "uniform").pvalue > 0.01


def test_levels_at_power_one_are_shares_of_draws():
    case = SimulatedCase(np.array([0.0, -1.0, -3.0, -4.0]), -2.0)
    assert levels_at_power([case], 1.0) == pytest.approx([0.5])
    # At power two the weights are 1, e^-1, e^-3, e^-4.
    weight = np.exp([0.0, -1.0, -3.0, -4.0])
    assert levels_at_power([case], 2.0) == pytest.approx([weight[:2].sum() / weight.sum()])
