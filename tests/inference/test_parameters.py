"""The box and its maps."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest, norm, truncnorm, uniform

from femupdate.inference import Parameter, Parameters
from tests.inference.gaussians import box

lower = st.floats(-50.0, 50.0)
width = st.floats(1e-3, 100.0)
share = st.floats(1e-6, 1.0 - 1e-6)


@settings(deadline=None)
@given(low=lower, size=width, unit=share)
def test_maps_are_inverse_of_one_another(low, size, unit):
    prior = box([low, 0.33], [low + size, 3.0])
    point = torch.tensor([[unit, 1.0 - unit]], dtype=torch.float64)
    theta = prior.from_unit(point)
    # A narrow box far from zero loses digits of the share, not of theta.
    slack = 1e-14 * (1.0 + abs(low) / size)
    np.testing.assert_allclose(prior.to_unit(theta), point, atol=slack)
    np.testing.assert_allclose(prior.from_unit(prior.to_unit(theta)), theta, rtol=1e-12)
    # The inverse of the normal distribution is right to ten digits of the share.
    back = (prior.from_normal(prior.to_normal(theta)) - theta) / (prior.upper - prior.lower)
    np.testing.assert_allclose(back, 0.0, atol=1e-10 + slack)


@settings(deadline=None)
@given(xi=st.floats(-8.0, 5.0))
def test_standard_normal_coordinates_are_those_of_scipy(xi):
    """Above +5 the share is 1 less 3e-7: theta itself has no digits left for xi."""
    prior = box([0.33], [3.0])
    theta = prior.from_normal(torch.tensor([[xi]], dtype=torch.float64))
    assert float(theta) == pytest.approx(0.33 + 2.67 * norm.cdf(xi), rel=1e-12)
    share = torch.tensor([[norm.cdf(xi)]], dtype=torch.float64)
    unit = box([0.0], [1.0])
    assert float(unit.to_normal(unit.from_unit(share))) == pytest.approx(xi, abs=1e-8)


def test_density_of_normal_coordinates():
    prior = box([0.0] * 3, [1.0, 2.0, 3.0])
    xi = torch.randn(7, 3, dtype=torch.float64)
    np.testing.assert_allclose(prior.log_density_normal(xi), norm.logpdf(xi).sum(1), rtol=1e-12)


def mixed():
    """A uniform parameter, a normal one within wide limits, a known one, and half of a normal."""
    return Parameters(
        (
            Parameter(name="theta_1", kind="stiffness", lower=0.3, upper=3.0),
            Parameter(name="a", kind="effect", lower=-0.5, upper=0.5, centre=0.1, scale=0.2),
            Parameter(name="zeta", kind="damping", lower=0.02, upper=0.02),
            Parameter(name="b", kind="effect", lower=0.0, upper=2.0, scale=0.4),
        )
    )


FREE = [0, 1, 3]


def expected(column):
    if column == 0:
        return uniform(0.3, 2.7)
    low, high, centre, scale = ((-0.5, 0.5, 0.1, 0.2), (0.0, 2.0, 0.0, 0.4))[column - 1]
    return truncnorm((low - centre) / scale, (high - centre) / scale, centre, scale)


def test_normal_parameters_within_limits_are_those_of_scipy():
    prior, unit = mixed(), np.linspace(0.001, 0.999, 41)
    theta = prior.from_unit(torch.from_numpy(np.tile(unit[:, None], 3)))
    for column in range(3):
        np.testing.assert_allclose(theta[:, FREE[column]], expected(column).ppf(unit), rtol=1e-9)
    np.testing.assert_allclose(prior.to_unit(theta), np.tile(unit[:, None], 3), rtol=1e-9)
    normal = prior.to_normal(theta)
    np.testing.assert_allclose(prior.from_normal(normal), theta, rtol=1e-8)
    drawn = prior.sample(4000, torch.Generator().manual_seed(1))
    # One test in a thousand fails by chance; the seed does not.
    columns = enumerate(FREE)
    assert all(kstest(drawn[:, k], expected(n).cdf).pvalue > 1e-3 for n, k in columns)


@settings(deadline=None)
@given(unit=st.lists(share, min_size=3, max_size=3))
def test_the_density_is_that_of_scipy(unit):
    prior = mixed()
    values = prior.from_unit(torch.tensor([unit], dtype=torch.float64))
    known = sum(expected(n).logpdf(float(values[0, k])) for n, k in enumerate(FREE))
    assert float(prior.log_density(values)) == pytest.approx(known, rel=1e-9, abs=1e-9)


@settings(deadline=None)
@given(xi=st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3))
def test_a_known_parameter_has_no_coordinate(xi):
    prior = mixed()
    values = prior.from_normal(torch.tensor([xi], dtype=torch.float64))
    assert (prior.size, values.shape) == (3, (1, 4))
    assert float(values[0, 2]) == 0.02
    np.testing.assert_allclose(prior.to_normal(values)[0], xi, atol=1e-6)
    assert prior.of("damping").from_normal(values.new_zeros(2, 0)).tolist() == [[0.02], [0.02]]
