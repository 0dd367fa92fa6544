"""Coverage, ranks and TARP on Gaussians whose posterior is known, right, too narrow or shifted."""

import numpy as np
import pytest
from femupdate.benchmarks.calibration import coverage
from scipy.stats import chi2, norm


def cases(width, count=1500, draws=400, seed=0):
    """theta ~ N(0, 1), x = theta + N(0, .5^2); posterior sd times `width`. Yields truth, draws."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=(count, 2))
    data = truth + 0.5 * rng.normal(size=truth.shape)
    variance = 1.0 / (1.0 + 4.0)
    mean, sd = 4.0 * data * variance, width * variance**0.5
    return truth, mean[:, None] + sd * rng.normal(size=(count, draws, 2)), mean, sd


def levels(width):
    truth, draws, mean, sd = cases(width)

    def log_density(theta, centre):
        return -0.5 * ((theta - centre) ** 2).sum(-1) / sd**2

    return np.array(
        [
            coverage.density_level(log_density(d, m), log_density(t, m))
            for t, d, m in zip(truth, draws, mean, strict=True)
        ]
    )


@pytest.mark.parametrize("width", [0.6, 1.0, 1.7])
def test_coverage_of_density_regions(width):
    """A region of probability q in two dimensions holds chi2 at width^2 times its own quantile."""
    found = coverage.coverage(levels(width))
    expected = chi2.cdf(width**2 * chi2.ppf(found.nominal, 2), 2)
    sd = np.sqrt(expected * (1.0 - expected) / found.cases)
    # 400 draws blur each level by up to .025.
    np.testing.assert_allclose(found.found, expected, atol=3.5 * sd.max() + 0.005)
    if width == 1.0:
        np.testing.assert_allclose(found.error, sd, rtol=1e-9)
        assert coverage.uniformity_p_value(levels(1.0)) > 1e-3
    else:
        assert coverage.uniformity_p_value(levels(width)) < 1e-9


@pytest.mark.parametrize("width", [0.6, 1.0, 1.7])
def test_ranks_and_central_intervals(width):
    truth, draws, _, _ = cases(width)
    found = np.array([coverage.ranks(d, t) for d, t in zip(draws, truth, strict=True)])
    inside = (coverage.central_level(found[:, 0]) <= 0.9).mean()
    expected = 2.0 * norm.cdf(width * norm.ppf(0.95)) - 1.0
    assert inside == pytest.approx(expected, abs=0.025)
    assert (coverage.rank_histogram_p_value(found[:, 1]) > 1e-3) == (width == 1.0)


def test_rank_of_a_tie_counts_half():
    draws = np.array([[0.0], [1.0], [1.0], [2.0]])
    assert coverage.ranks(draws, [1.0]) == pytest.approx([0.5])
    assert coverage.ranks(draws, [-1.0]) == pytest.approx([0.0])


@pytest.mark.parametrize("width", [0.6, 1.0])
def test_tarp_levels(width):
    truth, draws, _, _ = cases(width)
    centres = np.random.default_rng(9).normal(size=truth.shape)
    found = np.array(
        [coverage.tarp_level(d, t, c) for d, t, c in zip(draws, truth, centres, strict=True)]
    )
    p_value = coverage.uniformity_p_value(found)
    assert p_value > 1e-3 if width == 1.0 else p_value < 1e-6
