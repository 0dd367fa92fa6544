"""The latent likelihood against quadrature and exact arithmetic."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad, quad
from scipy.stats import norm

from femupdate.surrogate.latent import latent_log_likelihood

variance = st.floats(1e-12, 0.999)
mean = st.floats(-4.0, 4.0)


def tensor(*values):
    return torch.tensor([values], dtype=torch.float64)


def exact(mean_x, variance_x, mean_theta, variance_theta):
    """One dimension, by completing the square in fifty digits."""
    with localcontext() as context:
        context.prec = 50
        a, A, b, B = (Decimal(v) for v in (mean_x, variance_x, mean_theta, variance_theta))
        precision = 1 / A + 1 / B - 1
        if precision <= 0:
            return -np.inf
        linear = a / A + b / B
        constant = a**2 / A + b**2 / B
        return float((linear**2 / precision - constant - (A * B * precision).ln()) / 2)


@pytest.mark.parametrize(
    ("mean_x", "variance_x", "mean_theta", "variance_theta"),
    [
        (0.3, 0.2, -0.5, 0.4),
        (1.9, 0.9, -1.2, 0.05),
        (-2.0, 0.99, 0.7, 0.98),
        (0.0, 0.003, 0.1, 0.002),
        (1.5, 1.4, 1.0, 0.7),
        (0.4, 30.0, 0.2, 0.5),
    ],
)
def test_one_dimension_against_quadrature(mean_x, variance_x, mean_theta, variance_theta):
    x, theta = norm(mean_x, variance_x**0.5), norm(mean_theta, variance_theta**0.5)

    def integrand(z):
        return np.exp(x.logpdf(z) + theta.logpdf(z) - norm.logpdf(z))

    joint = 1.0 / (1.0 / variance_x + 1.0 / variance_theta - 1.0)
    centre = joint * (mean_x / variance_x + mean_theta / variance_theta)
    reach = 12.0 * joint**0.5
    value = quad(integrand, centre - reach, centre + reach, points=[centre], epsabs=0.0)[0]
    found = latent_log_likelihood(
        tensor(mean_x), tensor(variance_x), tensor(mean_theta), tensor(variance_theta)
    )
    assert float(found) == pytest.approx(np.log(value), abs=1e-8)


def test_two_dimensions_against_quadrature():
    mean_x, variance_x = np.array([0.4, -0.7]), np.array([0.3, 0.6])
    mean_theta, variance_theta = np.array([-0.2, 0.1]), np.array([0.5, 0.25])

    def integrand(v, u):
        z = np.array([u, v])
        terms = norm.logpdf(z, mean_x, variance_x**0.5)
        terms += norm.logpdf(z, mean_theta, variance_theta**0.5) - norm.logpdf(z)
        return np.exp(terms.sum())

    value = dblquad(integrand, -4.0, 4.0, -4.5, 4.0, epsabs=1e-8)[0]
    found = latent_log_likelihood(
        *(torch.from_numpy(a)[None] for a in (mean_x, variance_x, mean_theta, variance_theta))
    )
    assert float(found) == pytest.approx(np.log(value), abs=1e-5)


@settings(max_examples=200, deadline=None)
@given(a=mean, A=variance, b=mean, B=variance)
def test_against_fifty_digits_for_all_variances(a, A, b, B):
    found = float(latent_log_likelihood(tensor(a), tensor(A), tensor(b), tensor(B)))
    expected = exact(a, A, b, B)
    # The largest term is (a - b)^2 / (A + B), of up to 1e13: nothing else may cancel.
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 + 1e-14 / (A + B))


def test_tiny_variances_do_not_cancel():
    """Means that agree to the width: the log density at zero of the sum of both errors."""
    for scale in (1e-3, 1e-6, 1e-9, 1e-12):
        A, B = 2.0 * scale**2, 0.7 * scale**2
        found = latent_log_likelihood(tensor(1.3), tensor(A), tensor(1.3), tensor(B))
        limit = -0.5 * np.log(A + B) + 0.5 * 1.3**2  # ln of N(0; 0, A + B) / N(1.3; 0, 1)
        assert float(found) == pytest.approx(limit, rel=1e-12, abs=2.0 * scale)


def test_single_precision_at_the_width_of_real_posteriors():
    rng = np.random.default_rng(0)
    spread = 10.0 ** rng.uniform(-3.5, 0.0, (2, 400))
    centre = rng.normal(size=400)
    means = centre + spread * rng.normal(size=(2, 400))
    values = (means[0], 0.9 * spread[0] ** 2, means[1], 0.9 * spread[1] ** 2)
    single = [torch.tensor(v, dtype=torch.float32)[:, None] for v in values]
    found = latent_log_likelihood(*single)
    double = latent_log_likelihood(*(one.double() for one in single))
    assert found.dtype == torch.float32
    # A mean of 1 is known to 6e-8, a five-thousandth of the narrowest width.
    np.testing.assert_allclose(found, double, rtol=1e-5, atol=1e-4)


@settings(max_examples=100, deadline=None)
@given(a=mean, A=st.floats(0.5, 50.0), b=mean, B=st.floats(0.5, 50.0))
def test_an_integral_that_diverges_is_minus_infinity(a, A, b, B):
    found = float(latent_log_likelihood(tensor(a), tensor(A), tensor(b), tensor(B)))
    room = 1.0 / A + 1.0 / B - 1.0
    if room <= -1e-12:
        assert found == -np.inf
    elif room > 1e-6:
        assert np.isfinite(found)
    assert not np.isnan(found)


def test_one_invalid_dimension_rules_the_point_out():
    means = tensor(0.1, 0.2, 0.3)
    found = latent_log_likelihood(means, tensor(0.2, 2.0, 0.1), -means, tensor(0.2, 2.0, 0.1))
    assert float(found) == -np.inf
    # On the edge itself, 1/2 + 1/2 - 1 = 0, the integral diverges too.
    assert (
        float(latent_log_likelihood(tensor(0.0), tensor(2.0), tensor(0.0), tensor(2.0))) == -np.inf
    )


@pytest.mark.parametrize("wrong", [0.0, np.inf, np.nan])
def test_variances_that_are_none_are_never_rewarded(wrong):
    found = float(latent_log_likelihood(tensor(0.1), tensor(wrong), tensor(0.1), tensor(wrong)))
    assert found == -np.inf


@settings(deadline=None)
@given(a=mean, A=variance, b=mean, B=variance)
def test_the_two_gaussians_may_change_places(a, A, b, B):
    one = latent_log_likelihood(tensor(a), tensor(A), tensor(b), tensor(B))
    other = latent_log_likelihood(tensor(b), tensor(B), tensor(a), tensor(A))
    torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-12)


def test_dimensions_add_up_and_leading_axes_broadcast():
    generator = torch.Generator().manual_seed(0)
    shape = (5, 7, 3)
    means = torch.randn(2, *shape, generator=generator, dtype=torch.float64)
    variances = torch.rand(2, *shape, generator=generator, dtype=torch.float64)
    full = latent_log_likelihood(means[0], variances[0], means[1], variances[1])
    assert full.shape == (5, 7)
    each = [
        latent_log_likelihood(
            means[0, ..., k : k + 1],
            variances[0, ..., k : k + 1],
            means[1, ..., k : k + 1],
            variances[1, ..., k : k + 1],
        )
        for k in range(3)
    ]
    torch.testing.assert_close(full, sum(each))
    one = latent_log_likelihood(means[0, 0, 0], variances[0, 0, 0], means[1], variances[1])
    assert one.shape == (5, 7)
    assert float(one[0, 0]) == pytest.approx(float(full[0, 0]), rel=1e-12)


def test_gradients_are_those_of_finite_differences():
    generator = torch.Generator().manual_seed(3)
    means = torch.randn(2, 4, 3, generator=generator, dtype=torch.float64)
    variances = 0.02 + 0.9 * torch.rand(2, 4, 3, generator=generator, dtype=torch.float64)
    inputs = [means[0], variances[0], means[1], variances[1]]
    for tensors in inputs:
        tensors.requires_grad_(True)
    assert torch.autograd.gradcheck(latent_log_likelihood, inputs)


def test_gradients_stay_finite_beside_invalid_points():
    values = [
        tensor(0.1, 0.5).requires_grad_(),
        tensor(3.0, 0.2).requires_grad_(),
        tensor(0.4, -0.2).requires_grad_(),
        tensor(2.0, 0.1).requires_grad_(),
    ]
    found = latent_log_likelihood(*values)
    good = latent_log_likelihood(*(v[:, 1:] for v in values))
    (found.nan_to_num(neginf=0.0) + good).sum().backward()
    for value in values:
        assert bool(torch.isfinite(value.grad).all())


def test_with_a_flat_second_gaussian_the_first_says_nothing():
    """q(z|theta) = p(z) makes the integral of q(z|x), which is one."""
    found = latent_log_likelihood(tensor(0.7), tensor(0.2), tensor(0.0), tensor(1.0))
    assert float(found) == pytest.approx(0.0, abs=1e-12)
