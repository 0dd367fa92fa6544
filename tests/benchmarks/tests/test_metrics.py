"""Distances between sets of draws, against Gaussians in closed form."""

import numpy as np
import pytest
import torch
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


def test_mmd_of_three_points_by_hand():
    k = np.exp(-0.5 * np.array([1.0, 4.0, 9.0]))  # of distances 1, 2 and 3
    squared = 1.0 + (1.0 + k[0]) / 2.0 - (k[1] + k[2])
    found = metrics.MmdReference([[2.0], [3.0]], 1.0)([[0.0]])
    assert found == pytest.approx(np.sqrt(squared), rel=1e-6)


def test_mmd_of_independent_draws_falls_with_their_square_root():
    rng = np.random.default_rng(1)
    reference = metrics.MmdReference(rng.normal(size=(8000, 2)))
    # Mean of the squared V-statistic: (1 - E k) (1/n + 1/m), with E k of independent draws.
    expected = 1.0 - reference.bandwidth**2 / (reference.bandwidth**2 + 2.0)
    for count in (100, 400):
        squares = [reference(rng.normal(size=(count, 2))) ** 2 for _ in range(20)]
        found = np.mean(squares) / (1.0 / count + 1.0 / 8000)
        # One square spreads by about its mean.
        assert found == pytest.approx(expected, rel=0.6)


def test_median_heuristic():
    # Squared distances of standard normals in p dimensions are 2 chi^2_p; its median at p = 4 is
    # 3.3567.
    draws = np.random.default_rng(2).normal(size=(5000, 4))
    assert metrics.median_distance(draws) == pytest.approx(np.sqrt(2.0 * 3.3567), rel=0.02)


def test_mean_kernel_in_strips():
    x = torch.linspace(0.0, 3.0, 2300, dtype=torch.float64)[:, None]
    y = torch.linspace(-1.0, 1.0, 7, dtype=torch.float64)[:, None]
    whole = np.exp(-0.5 * (x.numpy() - y.numpy().T) ** 2 / 0.49).mean()
    assert metrics.mean_kernel(x, y, 0.7) == pytest.approx(whole, rel=1e-5)


@pytest.mark.parametrize(("shift", "expected"), [(0.0, 0.5), (1.0, 0.6915), (2.0, 0.8413)])
def test_classifier_accuracy_of_two_gaussians(shift, expected):
    """The best classifier of N(0, 1) and N(d, 1) is right with probability Phi(d / 2)."""
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(1500, 2)), rng.normal(size=(1800, 2))
    y[:, 0] += shift
    # 3,000 labels: binomial sd .009; a network is a little below the best.
    assert metrics.classifier_accuracy(x, y) == pytest.approx(expected, abs=0.035)


def test_narrow_modes_need_local_coordinates():
    """Modes twice as wide: seen in offsets from the modes, not in plain coordinates."""
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(4)
    centres = np.array([[0.0, 0.0], [1.0, 2.0]])
    sd = np.full((2, 2), 1e-3)

    def draws(scale):
        member = rng.integers(2, size=1500)
        return centres[member] + scale * 1e-3 * rng.normal(size=(1500, 2))

    one, other = draws(1.0), draws(2.0)
    local = [metrics.local_coordinates(x, centres, centres, sd) for x in (one, other)]
    # Best rule |r| < c: chi distributions with two degrees of freedom, accuracy .736 at ratio 2.
    assert metrics.classifier_accuracy(*local) == pytest.approx(0.736, abs=0.03)


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


def test_total_variation():
    assert metrics.total_variation([0.5, 0.3, 0.2], [0.2, 0.3, 0.5]) == pytest.approx(0.3)
