"""The chain of the No-U-Turn sampler, and what is said without Pyro."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.shear4dof.case import authors_case, data_likelihood
from femupdate.benchmarks.shear4dof.nuts import nuts_chain
from femupdate.benchmarks.shear4dof.run import QUICK, run_shear4dof
from femupdate.benchmarks.shipped import benchmark_model, shipped_surrogate

from femupdate.errors import InferenceError
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.parameters import Parameters


def test_without_pyro_one_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyro", None)
    with pytest.raises(InferenceError, match=r'pip install "femupdate\[nuts\]"'):
        run_shear4dof(Job(tmp_path), replace(QUICK, nuts=100))


def test_a_gaussian(monkeypatch):
    pytest.importorskip("pyro")
    bounds = (torch.zeros(2, dtype=torch.float64), torch.tensor([1.0, 3.0], dtype=torch.float64))
    prior = Parameters.uniform(("a", "b"), *bounds)

    def log_likelihood(theta):
        xi = prior.to_normal(theta)
        return -0.5 * ((xi[:, 0] - 0.8) ** 2 / 0.5**2 + (xi[:, 1] + 0.3) ** 2 / 0.2**2)

    chain = nuts_chain(prior, log_likelihood, 1000, 1)
    xi = prior.to_normal(chain.theta).numpy()
    assert xi.shape == (900, 2)
    assert chain.evaluations > 2000
    variance = 1.0 / (1.0 + 1.0 / np.array([0.5, 0.2]) ** 2)
    mean = variance * np.array([0.8, -0.3]) / np.array([0.5, 0.2]) ** 2
    # Some hundreds of independent draws.
    np.testing.assert_allclose((xi.mean(0) - mean) / variance**0.5, 0.0, atol=0.2)
    np.testing.assert_allclose(xi.std(0), variance**0.5, rtol=0.15)
    again = nuts_chain(prior, log_likelihood, 50, 1)
    assert torch.equal(nuts_chain(prior, log_likelihood, 50, 1).theta, again.theta)


def test_both_likelihoods_have_gradients():
    model = benchmark_model()
    case, surrogate = authors_case(model), shipped_surrogate(model.building)
    latent = LatentLikelihood(surrogate, model.system, case.observation)
    data = data_likelihood(model, case)
    theta = torch.tensor([[1.02, 0.97, 1.01, 1.0]], dtype=torch.float64)
    step = 1e-3 * torch.eye(4, dtype=torch.float64)
    # float32 responses: differences of the data likelihood are good to some hundredths.
    for likelihood, tolerance in ((latent, 0.05), (data, 0.05)):
        at = theta.clone().requires_grad_()
        (slope,) = torch.autograd.grad(likelihood(at).sum(), at)
        with torch.no_grad():
            plain = likelihood(theta + step) - likelihood(theta - step)
        torch.testing.assert_close(slope[0], (plain / 2e-3).double(), rtol=tolerance, atol=2.0)
