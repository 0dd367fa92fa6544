"""The terms of Laplace's evidence, each against scipy, where the integrand is what it assumes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.stats import truncnorm

from femupdate.discrepancy.evidence import laplace, log_prior, log_target, student_about
from femupdate.discrepancy.fit import densities, fit
from femupdate.inference.joint_error import summed

GRID = np.linspace(0.5, 12.0, 8)
PRIOR_MEAN, PRIOR_SD = 0.3, 0.5


@pytest.fixture(scope="module")
def fitted(building_of, observe, pose, place):
    """Two factors, a damping ratio and a size, on whose fit nothing here depends."""
    building = building_of([2.0, 1.0], [3000.0, 2000.0], zeta=(0.01, 0.2))
    observation = observe(("RF",), GRID, np.ones((1, GRID.size), dtype=complex), 0.25, 1)
    problem = pose(building, observation)
    placed = place("added_mass@2F")
    return fit(problem, placed, torch.tensor([0.1, -0.2, np.log(0.05), 0.0]).double(), 1)


@pytest.fixture(scope="module")
def informed(fitted):
    """A function: the fit with other unknowns, limits and standard deviations by the data.

    Where the data say nothing, a standard deviation is infinite.
    """

    def make(z, sd, lower, upper):
        one = torch.zeros_like(fitted.jacobian)
        one[range(4), range(4)] = 1.0 / torch.tensor(sd, dtype=torch.float64)
        where = replace(
            fitted.steps,
            lower=torch.tensor(lower, dtype=torch.float64),
            upper=torch.tensor(upper, dtype=torch.float64),
            mean=torch.tensor([0.0, 0.0, 0.0, PRIOR_MEAN], dtype=torch.float64),
            precision=torch.diag(torch.tensor([0.0, 0.0, 0.0, PRIOR_SD**-2], dtype=torch.float64)),
        )
        z = torch.tensor(z, dtype=torch.float64)
        return replace(fitted, z=z, jacobian=one, steps=where)

    return make


Z = [0.1, -0.3, np.log(0.05), 0.4]
LOWER = [np.log(0.5), np.log(0.5), np.log(0.01), -0.2]
UPPER = [np.log(2.0), np.log(2.0), np.log(0.2), 0.9]


def prior_at(z):
    """theta uniform from .5 to 2, zeta from .01 to .2, both by their logarithms; a size."""
    low, high = ((end - PRIOR_MEAN) / PRIOR_SD for end in (LOWER[3], UPPER[3]))
    size = truncnorm.logpdf(z[3], low, high, PRIOR_MEAN, PRIOR_SD)
    return z[0] + z[1] - 2.0 * np.log(1.5) + z[2] - np.log(0.19) + size


def gaussian_within(z, sd, lower, upper):
    """Log integral between limits of what is one at z and falls off as a normal density."""
    return np.log(quad(lambda x: np.exp(-0.5 * ((x - z) / sd) ** 2), lower, upper)[0])


def test_prior_density_is_that_of_scipy(informed):
    one = informed(Z, [1.0] * 4, LOWER, UPPER)
    other = [0.5, -0.6, np.log(0.15), -0.1]
    found = log_prior(one, torch.tensor([Z, other], dtype=torch.float64))
    np.testing.assert_allclose(found, [prior_at(Z), prior_at(other)], rtol=1e-12)


@pytest.mark.parametrize("z", [Z, [np.log(2.0), -0.3, np.log(0.01), -0.2]], ids=["in", "at limits"])
def test_laplace_where_each_unknown_is_normal_within_its_limits(informed, z):
    sd = [0.2, 0.9, 0.7, 0.6]
    one = informed(z, sd, LOWER, UPPER)
    both = [*sd[:3], (sd[3] ** -2 + PRIOR_SD**-2) ** -0.5]  # the size has a normal prior as well
    parts = zip(z, both, LOWER, UPPER, strict=True)
    expected = prior_at(z) + sum(gaussian_within(*part) for part in parts)
    # The curvature that fills in for what the data leave open is there all the time.
    limits = 2.0 * np.pi / (np.array(UPPER) - LOWER) ** 2
    narrower = [0.5 * np.log1p(limits[k] * sd[k] ** 2) for k in range(3)]
    found = laplace(one.likelihood, one).log_evidence - float(
        summed(densities(one.likelihood, one))
    )
    assert found == pytest.approx(expected - sum(narrower), abs=1e-9)


def test_what_the_data_leave_open_counts_by_its_whole_width(informed):
    one = informed(Z, [np.inf, 0.01, np.inf, 0.01], LOWER, UPPER)
    narrow = (0.01**-2 + PRIOR_SD**-2) ** -0.5
    widths = [UPPER[k] - LOWER[k] for k in (0, 2)]
    known = gaussian_within(Z[1], 0.01, Z[1] - 0.1, Z[1] + 0.1)
    known += gaussian_within(Z[3], narrow, Z[3] - 0.1, Z[3] + 0.1)
    expected = prior_at(Z) + np.log(widths).sum() + known
    found = laplace(one.likelihood, one).log_evidence - float(
        summed(densities(one.likelihood, one))
    )
    assert found == pytest.approx(expected, abs=4e-4)  # the limits narrow the known ones by so much


def test_points_at_a_limit_are_possible_and_those_beyond_are_not(fitted):
    lower, upper = fitted.steps.lower.clone(), fitted.steps.upper.clone()
    lower[3], upper[3] = -0.5, 0.5
    inside = replace(fitted, steps=replace(fitted.steps, lower=lower, upper=upper))
    points = torch.stack([lower, upper, lower - 1e-6, upper + 1e-6])
    _, log_likelihood = log_target(fitted.likelihood, inside)(points)
    assert torch.isfinite(log_likelihood).tolist() == [True, True, False, False]


def test_proposal_has_the_covariance_of_data_prior_and_limits(informed):
    sd = [0.2, np.inf, 0.7, 0.6]
    upper = [*UPPER[:3], np.inf]
    one = informed(Z, sd, LOWER, upper)
    width = np.array(upper) - LOWER
    precision = np.array(sd) ** -2 + 12.0 / width**2  # a uniform density has width^2 / 12
    precision[3] += PRIOR_SD**-2
    drawn = student_about(one, 1.3, 6)
    found = drawn.gaussian.cholesky[0] @ drawn.gaussian.cholesky[0].T
    np.testing.assert_allclose(found, np.diag(1.3 / precision), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(drawn.gaussian.mean[0], Z)
    assert drawn.freedom == 6
