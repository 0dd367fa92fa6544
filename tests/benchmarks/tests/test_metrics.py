"""Distances between sets of draws, against Gaussians in closed form."""

import numpy as np
import pytest
from femupdate.benchmarks.shear4dof import metrics


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
