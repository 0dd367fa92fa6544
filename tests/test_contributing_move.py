"""The move of CONTRIBUTING.md draws a posterior and an evidence known in closed form."""

import runpy

import numpy as np
import pytest

from femupdate.inference import SmcSettings, TemperedSmc
from tests.helpers import of_contributing
from tests.inference.gaussians import LinearGaussian, box

A = np.array([[1.0, 0.4], [-0.3, 2.0], [0.6, 0.5]])
# It leans.
EXACT = LinearGaussian(A, np.array([1.3, -0.8, 2.1]), 0.4)
PRIOR = box([0.3, -5.0], [3.0, 2.0])


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The two pieces of code of the section: the move, and how it is used."""
    move, use = of_contributing("A new move of the sampler")
    path = tmp_path_factory.mktemp("move") / "crank_nicolson.py"
    path.write_text(move)
    return runpy.run_path(str(path)), use


def test_it_draws_the_posterior_with_its_evidence(page):
    names, use = page
    known = {**names, "TemperedSmc": TemperedSmc, "prior": PRIOR, "log_likelihood": EXACT.on(PRIOR)}
    exec(use, known)
    result = known["result"]
    xi, sd = PRIOR.to_normal(result.theta).numpy(), np.sqrt(np.diag(EXACT.covariance))
    # 2,000 particles, some of them alike after resampling.
    np.testing.assert_allclose((xi.mean(0) - EXACT.mean) / sd, 0.0, atol=0.15)
    np.testing.assert_allclose(
        np.linalg.solve(EXACT.covariance, np.cov(xi.T)), np.eye(2), atol=0.25
    )
    assert result.log_evidence == pytest.approx(EXACT.log_evidence, abs=0.2)


def test_a_run_tunes_a_copy_of_the_move(page):
    move = page[0]["CrankNicolson"]()
    settings = SmcSettings(unmoved=0.0)
    sampler = TemperedSmc(PRIOR, EXACT.on(PRIOR), settings=settings, moves=((move, 5),))
    assert sampler.run(200, 3).theta.equal(sampler.run(200, 3).theta)
    assert move.size == 0.5
