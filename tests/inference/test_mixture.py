"""Gaussian mixtures against scipy."""

import numpy as np
import torch
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from femupdate.inference.importance import Mixture, fit_mixture

WEIGHT = np.array([0.5, 0.2, 0.3])
MEAN = np.array([[0.0, 1.0], [4.0, -3.0], [-5.0, 0.5]])
COVARIANCE = np.array(
    [[[1.0, 0.6], [0.6, 0.8]], [[0.3, -0.1], [-0.1, 2.0]], [[0.05, 0.0], [0.0, 0.4]]]
)


def mixture(weight=WEIGHT, mean=MEAN, covariance=COVARIANCE):
    return Mixture(
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
