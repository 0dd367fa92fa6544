"""Gaussian mixtures against scipy."""

import numpy as np
import pytest
import torch
from scipy.special import logsumexp
from scipy.stats import kstest, multivariate_normal, norm

from femupdate.inference.importance import GaussianMixture, fit_mixture

WEIGHT = np.array([0.5, 0.2, 0.3])
MEAN = np.array([[0.0, 1.0], [4.0, -3.0], [-5.0, 0.5]])
COVARIANCE = np.array(
    [[[1.0, 0.6], [0.6, 0.8]], [[0.3, -0.1], [-0.1, 2.0]], [[0.05, 0.0], [0.0, 0.4]]]
)


def mixture(weight=WEIGHT, mean=MEAN, covariance=COVARIANCE):
    return GaussianMixture(
        torch.from_numpy(weight).log(),
        torch.from_numpy(mean),
        torch.linalg.cholesky(torch.from_numpy(covariance)),
    )


def draws(count, seed=0):
    rng = np.random.default_rng(seed)
    which = rng.choice(3, size=count, p=WEIGHT)
    x = np.array([rng.multivariate_normal(MEAN[k], COVARIANCE[k]) for k in which])
    return torch.from_numpy(x)


def test_density_is_that_of_scipy():
    x = np.random.default_rng(1).normal(scale=4.0, size=(50, 2))
    parts = [
        np.log(w) + multivariate_normal(m, c).logpdf(x)
        for w, m, c in zip(WEIGHT, MEAN, COVARIANCE, strict=True)
    ]
    found = mixture().component_log_density(torch.from_numpy(x))
    np.testing.assert_allclose(found, np.stack(parts, axis=1), rtol=1e-12)
    np.testing.assert_allclose(
        mixture().log_density(torch.from_numpy(x)), logsumexp(parts, axis=0), rtol=1e-12
    )


def test_samples_follow_the_density():
    x = mixture().sample(4000, torch.Generator().manual_seed(2)).numpy()
    assert x.shape == (4000, 2)
    spread = np.sqrt(COVARIANCE.diagonal(axis1=1, axis2=2))
    for column in range(2):

        def cdf(value, column=column):
            each = norm.cdf((value[:, None] - MEAN[:, column]) / spread[:, column])
            return each @ WEIGHT

        assert kstest(x[:, column], cdf).pvalue > 0.01
    first = x[np.abs(x[:, 0]) < 2.0]
    assert np.corrcoef(first.T)[0, 1] == pytest.approx(0.6 / 0.8**0.5, abs=0.05)


def test_a_known_mixture_is_recovered():
    x = draws(6000)
    found = fit_mixture(x, 3, torch.Generator().manual_seed(0))
    order = np.argsort(found.mean[:, 0].numpy())
    expected = np.argsort(MEAN[:, 0])
    # 1200 draws of the smallest component: standard errors of .01, .04 and 6 %.
    np.testing.assert_allclose(found.log_weight.exp()[order], WEIGHT[expected], atol=0.02)
    np.testing.assert_allclose(found.mean[order], MEAN[expected], atol=0.12)
    covariance = (found.cholesky @ found.cholesky.transpose(1, 2))[order]
    np.testing.assert_allclose(covariance, COVARIANCE[expected], atol=0.2)
    # No worse, on its own data, than the mixture they came from.
    assert float(found.log_density(x).mean()) >= float(mixture().log_density(x).mean()) - 1e-3


@pytest.mark.parametrize("components", [1, 2, 8])
@pytest.mark.parametrize(
    "degenerate",
    [
        lambda g: torch.full((40, 3), 0.7, dtype=torch.float64),
        lambda g: torch.randn(40, 1, generator=g, dtype=torch.float64).expand(40, 3).clone(),
        lambda g: torch.randn(3, 3, generator=g, dtype=torch.float64),
        lambda g: torch.randn(2, 3, generator=g, dtype=torch.float64).repeat(20, 1),
        lambda g: 1e9 + 1e-3 * torch.randn(40, 3, generator=g, dtype=torch.float64),
    ],
    ids=["one point", "a line", "fewer than components", "two points", "far away"],
)
def test_degenerate_particles_give_a_mixture_all_the_same(components, degenerate):
    generator = torch.Generator().manual_seed(1)
    x = degenerate(generator)
    found = fit_mixture(x, components, generator)
    assert bool(torch.isfinite(found.log_density(x)).all())
    assert bool(torch.isfinite(found.sample(50, generator)).all())
    assert float(found.log_weight.exp().sum()) == pytest.approx(1.0, abs=1e-9)
