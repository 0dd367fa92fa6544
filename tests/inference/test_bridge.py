"""The bridge between two likelihoods, in closed form, over short and long ways."""

import numpy as np
import pytest
import torch

from femupdate.inference.bridge import Start, bridge
from femupdate.inference.importance import ImportanceSettings
from femupdate.inference.smc import TemperedSmc

A = np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]])
TARGET = (A, np.array([1.3, -0.8, 2.1, 0.4]), 0.3)
# Wider and beside the target, as a latent posterior is.
BASE = (A, np.array([1.2, -0.9, 2.4, 0.3]), 0.5)
# Of so few draws and rounds that a long way needs tempering.
HASTY = ImportanceSettings(rounds=1)


@pytest.fixture
def prior(box):
    return box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0])


@pytest.mark.parametrize("far", [False, True])
def test_closed_form(prior, linear_gaussian, far):
    target = linear_gaussian(*TARGET)
    data = BASE[1] + (2.0 if far else 0.0)
    base = linear_gaussian(A, data, BASE[2]).on(prior)
    start = TemperedSmc(prior, base).run(1000, 0)
    found = bridge(
        prior, target.on(prior), Start(start, base), 1, importance=HASTY if far else None
    )
    # An importance sample takes six likelihoods a particle, tempering many more.
    assert (found.evaluations > 20_000) == far
    assert found.log_evidence == pytest.approx(target.log_evidence, abs=0.1)
    assert abs(found.log_evidence - target.log_evidence) < 5.0 * found.log_evidence_error + 1e-3
    xi = prior.to_normal(found.theta).numpy()
    sd = np.sqrt(np.diag(target.covariance))
    # 1,000 draws, some repeated: standard errors of .04 sd and 5 % of a variance.
    np.testing.assert_allclose((xi.mean(0) - target.mean) / sd, 0.0, atol=0.15)
    np.testing.assert_allclose(xi.var(0) / sd**2, 1.0, atol=0.25)
    torch.testing.assert_close(found.log_likelihood, target.on(prior)(found.theta))


def test_evaluations_are_counted_one_by_one(prior, linear_gaussian, recorder):
    target, base = linear_gaussian(*TARGET).on(prior), linear_gaussian(*BASE).on(prior)
    seen, told = [], recorder()

    def counted(theta):
        seen.append(len(theta))
        return target(theta)

    start = TemperedSmc(prior, base).run(500, 0)
    found = bridge(prior, counted, Start(start, base), 1, progress=told)
    assert found.evaluations == sum(seen) == sum(told.counts)
    # The same posterior sampled from its prior.
    assert found.evaluations < 0.5 * TemperedSmc(prior, target).run(500, 0).evaluations


def test_particles_of_the_target_itself_are_kept_where_nothing_better_is_found(box):
    """One point in twenty is possible, in stripes that no mixture of Gaussians can follow."""
    prior = box([0.0] * 2, [1.0] * 2)

    def striped(theta):
        return torch.where((1e4 * theta[:, 0]) % 1.0 < 0.05, 0.0, -torch.inf)

    start = TemperedSmc(prior, striped).run(4000, 0)
    found = bridge(prior, striped, Start(start), 1)
    assert np.isnan(found.log_evidence_error)
    assert found.effective_share == 0.0
    assert torch.equal(found.theta, start.theta)
    assert found.log_evidence == start.log_evidence
