"""Distances between sets of draws, against Gaussians in closed form."""

import numpy as np
import pytest
from femupdate.benchmarks.shear4dof import metrics


def population_mmd(shift, bandwidth, size):
    """Two normals d apart; E k = (b^2 / (b^2 + 2))^(p/2) exp(-d^2 / 2 (b^2 + 2))."""
    same = (bandwidth**2 / (bandwidth**2 + 2.0)) ** (size / 2)
    return np.sqrt(2.0 * same * (1.0 - np.exp(-(shift**2) / (2.0 * (bandwidth**2 + 2.0)))))


@pytest.mark.parametrize(("shift", "bandwidth"), [(2.0, 1.3), (0.7, 3.0)])
def test_mmd_of_two_gaussians(shift, bandwidth):
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(4000, 3)), rng.normal(size=(6000, 3))
    y[:, 1] += shift
    found = metrics.MmdReference(y, bandwidth)(x)
    # The bias of the V-statistic is (1 - E k) (1/n + 1/m) = 4e-4 in the square at most.
    assert found == pytest.approx(population_mmd(shift, bandwidth, 3), abs=0.01)


@pytest.mark.parametrize(("shift", "expected"), [(0.0, 0.5), (1.0, 0.6915), (2.0, 0.8413)])
def test_classifier_accuracy_of_two_gaussians(shift, expected):
    """The best classifier of N(0, 1) and N(d, 1) is right with probability Phi(d / 2)."""
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(1500, 2)), rng.normal(size=(1800, 2))
    y[:, 0] += shift
    # 3,000 labels: binomial sd .009; a network is a little below the best.
    assert metrics.classifier_accuracy(x, y) == pytest.approx(expected, abs=0.035)


def test_mode_summary():
    rng = np.random.default_rng(5)
    centres = np.array([[0.0, 0.0], [5.0, 0.0], [9.0, 9.0]])
    draws = np.concatenate(
        [rng.normal([0.2, 0.0], [0.1, 0.3], (3000, 2)), rng.normal([5.0, 0.1], 0.2, (1000, 2))]
    )
    found = metrics.mode_summary(draws, centres, [1.0, 1.0])
    np.testing.assert_allclose(found.weight, [0.75, 0.25, 0.0])
    np.testing.assert_allclose(found.mean[:2], [[0.2, 0.0], [5.0, 0.1]], atol=0.03)
    np.testing.assert_allclose(found.sd[:2], [[0.1, 0.3], [0.2, 0.2]], rtol=0.08)
    assert np.isnan(found.mean[2]).all()
    assert (found.member[:3000] == 0).all()
