"""Errors that points share as part of the noise."""

import numpy as np
import pytest
import torch
from scipy.stats import multivariate_normal

from femupdate.discrepancy.common_errors import CommonErrors


@pytest.mark.parametrize("count", [1, 3, 9])
def test_whitened_residuals_have_unit_covariance(count):
    """W (I + S S^T) W^T = I for whatever S, more errors than points among them."""
    rng = np.random.default_rng(count)
    steps = rng.standard_normal((6, count)) * rng.uniform(0.1, 30.0, count)
    common = CommonErrors.of(torch.from_numpy(steps))
    W = common.whiten(torch.eye(6, dtype=torch.float64)).numpy().T
    np.testing.assert_allclose(W @ (np.eye(6) + steps @ steps.T) @ W.T, np.eye(6), atol=1e-9)


@pytest.mark.parametrize("count", [1, 3, 9])
def test_the_density_is_that_of_the_normal_distribution(count):
    """ln N(r; 0, I + S S^T) by scipy, but for the constant of independent points."""
    rng = np.random.default_rng(count)
    steps = rng.standard_normal((6, count)) * rng.uniform(0.1, 3.0, count)
    common, residual = CommonErrors.of(torch.from_numpy(steps)), rng.standard_normal(6)
    squares = float(common.whiten(torch.from_numpy(residual)[None]).square().sum())
    expected = multivariate_normal(np.zeros(6), np.eye(6) + steps @ steps.T).logpdf(residual)
    told = -0.5 * squares - common.half_log_determinant - 3.0 * np.log(2.0 * np.pi)
    assert told == pytest.approx(expected, rel=1e-10)


def test_what_is_not_along_them_stays_as_it_is():
    steps = torch.tensor([[3.0], [4.0], [0.0]], dtype=torch.float64)
    across = torch.tensor([[4.0, -3.0, 2.0]], dtype=torch.float64)
    assert torch.allclose(CommonErrors.of(steps).whiten(across), across)
