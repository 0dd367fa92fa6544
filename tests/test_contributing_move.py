"""The move of CONTRIBUTING.md draws a posterior and an evidence known in closed form."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
import torch

from femupdate.inference import Parameters, SmcSettings, TemperedSmc

PAGE = Path(__file__).resolve().parents[1] / "CONTRIBUTING.md"
A = torch.tensor([[1.0, 0.4], [-0.3, 2.0], [0.6, 0.5]], dtype=torch.float64)
DATA, NOISE = torch.tensor([1.3, -0.8, 2.1], dtype=torch.float64), 0.4
PRIOR = Parameters.uniform(
    ("a", "b"), torch.tensor([0.3, -5.0]).double(), torch.tensor([3.0, 2.0]).double()
)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The two pieces of code of the section: the move, and how it is used."""
    section = PAGE.read_text().split("\n## A new move of the sampler\n")[1].split("\n## ")[0]
    move, use = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    path = tmp_path_factory.mktemp("move") / "crank_nicolson.py"
    path.write_text(move)
    return runpy.run_path(str(path)), use


def log_likelihood(parameters):
    """Of DATA = A xi + noise, xi the prior's standard normal coordinates: it leans."""
    residual = PRIOR.to_normal(parameters) @ A.T - DATA
    return -0.5 * residual.square().sum(1) / NOISE**2


def test_it_draws_the_posterior_with_its_evidence(page):
    names, use = page
    known = {**names, "TemperedSmc": TemperedSmc, "prior": PRIOR, "log_likelihood": log_likelihood}
    exec(use, known)
    result = known["result"]
    precision = np.eye(2) + (A.T @ A).numpy() / NOISE**2
    covariance = np.linalg.inv(precision)
    mean = covariance @ (A.T @ DATA).numpy() / NOISE**2
    total = (A @ A.T).numpy() + NOISE**2 * np.eye(3)
    misfit = DATA.numpy() @ np.linalg.solve(total, DATA.numpy())
    evidence = -0.5 * misfit - 0.5 * np.linalg.slogdet(total)[1] + 3.0 * np.log(NOISE)
    xi, sd = PRIOR.to_normal(result.theta).numpy(), np.sqrt(np.diag(covariance))
    # 2,000 particles, some of them alike after resampling.
    np.testing.assert_allclose((xi.mean(0) - mean) / sd, 0.0, atol=0.15)
    np.testing.assert_allclose(np.linalg.solve(covariance, np.cov(xi.T)), np.eye(2), atol=0.25)
    assert result.log_evidence == pytest.approx(evidence, abs=0.2)


def test_a_run_tunes_a_copy_of_the_move(page):
    move = page[0]["CrankNicolson"]()
    settings = SmcSettings(unmoved=0.0)
    sampler = TemperedSmc(PRIOR, log_likelihood, settings=settings, moves=((move, 5),))
    assert torch.equal(sampler.run(200, 3).theta, sampler.run(200, 3).theta)
    assert move.size == 0.5
