"""Densities against the normal distribution, units and figures against what one would write."""

import numpy as np
import pytest
from scipy.stats import norm

from femupdate.report import plus_minus
from femupdate.report.plot_posterior import density_1d, density_2d, mass_level
from femupdate.report.scale import force_scale, length_scale

NORMAL = np.random.default_rng(2).normal(size=(2, 40000))


def test_density_is_that_of_the_normal_distribution():
    centres, density = density_1d(NORMAL[0], (-5.0, 5.0))
    exact = norm.pdf(centres) * (centres[1] - centres[0])
    assert np.abs(density - exact).max() < 0.03 * exact.max()  # 40,000 samples, smoothed


def test_separate_modes_are_not_smeared():
    """Two narrow modes far apart: the higher is as high as its own normal, within a tenth."""
    rng = np.random.default_rng(3)
    samples = np.concatenate([rng.normal(1.0, 0.02, 6000), rng.normal(2.5, 0.02, 4000)])
    centres, density = density_1d(samples, (0.9, 2.6))
    cell = centres[1] - centres[0]
    assert density.max() == pytest.approx(0.6 * norm.pdf(0.0, scale=0.02) * cell, rel=0.1)


def test_contours_hold_their_share_of_samples():
    x, y = NORMAL[0], 0.5 * NORMAL[0] + 2.0 * NORMAL[1]
    *centres, density = density_2d(x, y, (-5.0, 5.0), (-9.0, 9.0))
    cell = tuple(
        np.clip(np.searchsorted(axis, values), 0, 79)
        for axis, values in zip(centres[::-1], (y, x), strict=True)
    )
    for share in (0.5, 0.9):
        inside = density[cell] >= mass_level(density, share)
        assert inside.mean() == pytest.approx(share, abs=0.03)  # cells and smoothing


@pytest.mark.parametrize(
    ("values", "unit"),
    [([3.0, -900.0], "N"), ([0.0], "N"), ([-2.5e5], "kN"), ([3e6], "kN"), ([6e6, 1.0], "MN")],
)
def test_force_unit(values, unit):
    assert force_scale(values).unit == unit


@pytest.mark.parametrize(
    ("values", "unit"), [([2e-6], "µm"), ([-3e-4], "mm"), ([0.3], "mm"), ([2.4], "m"), ([], "µm")]
)
def test_length_unit(values, unit):
    assert length_scale(values).unit == unit


@pytest.mark.parametrize(
    ("mean", "sd", "text"),
    [
        (1.23456, 0.0456, "1.235 ± 0.046"),
        (123.4, 11.9, "123 ± 12"),
        (5.0, 0.0, "5"),
        (-0.5, 0.2, "-0.50 ± 0.20"),
    ],
)
def test_plus_minus(mean, sd, text):
    assert plus_minus(mean, sd) == text
