"""The latent likelihood against quadrature."""

import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from femupdate.inference.latent_search import FoundLatent, latent_quadratics
from tests.helpers import tensor


def one_component(mean, information):
    return FoundLatent(tensor([0.0]), tensor([mean]), tensor([information]))


@pytest.mark.parametrize(
    ("mean_x", "information", "mean_theta", "variance_theta"),
    [
        (0.3, 4.0, -0.5, 0.4),
        (1.9, 0.1, -1.2, 0.05),
        (-2.0, 0.0, 0.7, 0.98),
        (0.0, 300.0, 0.1, 0.002),
        (1.5, 0.7, 1.0, 1.0),
    ],
)
def test_one_dimension_against_quadrature(mean_x, information, mean_theta, variance_theta):
    x = norm(mean_x, (1.0 + information) ** -0.5)
    theta = norm(mean_theta, variance_theta**0.5)

    def integrand(z):
        return np.exp(x.logpdf(z) + theta.logpdf(z) - norm.logpdf(z))

    precision = information + 1.0 / variance_theta
    centre = ((1.0 + information) * mean_x + mean_theta / variance_theta) / precision
    reach = 12.0 * precision**-0.5
    value = quad(integrand, centre - reach, centre + reach, points=[centre], epsabs=0.0)[0]
    observed = one_component([mean_x], [[information]])
    found = latent_quadratics(observed, tensor([[variance_theta]]))(torch.tensor([[mean_theta]]))
    assert float(found) == pytest.approx(np.log(value), abs=2e-6)


def test_a_mixture_in_two_dimensions_against_quadrature():
    weights = np.array([0.3, 0.7])
    means = np.array([[0.4, -0.7], [-0.6, 0.5]])
    information = np.array([[[3.0, 1.0], [1.0, 2.0]], [[1.5, -0.8], [-0.8, 0.9]]])
    mean_theta, spread = np.array([-0.2, 0.1]), np.array([[0.5, 0.15], [0.15, 0.25]])
    covariance = np.linalg.inv(information + np.eye(2))
    parts = [multivariate_normal(m, c) for m, c in zip(means, covariance, strict=True)]
    said = multivariate_normal(mean_theta, spread)

    # Smooth and zero at the ends, so that a sum over a grid is exact to many digits.
    step = 0.02
    z = np.stack(np.meshgrid(np.arange(-4.0, 4.0, step), np.arange(-4.5, 4.5, step)), axis=-1)
    seen = logsumexp([part.logpdf(z) for part in parts], b=weights[:, None, None], axis=0)
    value = np.exp(seen + said.logpdf(z) - norm.logpdf(z).sum(-1)).sum() * step**2
    observed = FoundLatent(tensor(np.log(weights)), tensor(means), tensor(information))
    found = latent_quadratics(observed, tensor(spread))(tensor(mean_theta)[None].float())
    assert float(found) == pytest.approx(np.log(value), abs=1e-5)


def test_a_coordinate_that_theta_says_nothing_of_is_integrated_out():
    """The marginal Gaussian of the other coordinate alone must give the same differences."""
    information = np.array([[50.0, 20.0], [20.0, 30.0]])
    both = one_component([0.4, 0.9], information)
    covariance = np.linalg.inv(information + np.eye(2))
    mean, sd = 0.4, covariance[0, 0] ** 0.5
    places = np.linspace(-0.2, 1.0, 7)
    means = torch.tensor(np.column_stack([places, np.zeros(7)])).float()
    found = latent_quadratics(both, tensor(np.diag([1e-9, 1.0])))(means).double().numpy()
    expected = norm.logpdf(places, mean, sd) - norm.logpdf(places)
    np.testing.assert_allclose(found - found[0], expected - expected[0], atol=2e-4)
