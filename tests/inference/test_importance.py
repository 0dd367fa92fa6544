"""Importance draws against posteriors and evidences in closed form."""

import numpy as np
import pytest
import torch

from femupdate.inference.importance import draws_about_particles
from tests.inference.gaussians import LinearGaussian, box

PROBLEM = (
    np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]]),
    np.array([1.3, -0.8, 2.1, 0.4]),
    0.3,
)


@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_linear_gaussian(shift):
    """Also from particles that lie three standard deviations off."""
    prior, exact = box([0.3, -5.0, 10.0], [3.0, 2.0, 11.0]), LinearGaussian(*PROBLEM)
    sd = np.sqrt(np.diag(exact.covariance))
    start = prior.to_normal(exact.draws(prior, 1000, 0)) + shift * torch.from_numpy(sd)
    found = draws_about_particles(prior, exact.on(prior), prior.from_normal(start), 8000, 1)
    assert found.effective > 0.5 * 8000
    error = found.log_evidence_error
    assert error < 0.01
    assert found.log_evidence == pytest.approx(exact.log_evidence, abs=4.0 * error)
    xi = prior.to_normal(found.resampled(4000, 2).theta).numpy()
    # 1,000 independent draws at least: standard error .032 sd and 4.5 % of a variance.
    np.testing.assert_allclose((xi.mean(0) - exact.mean) / sd, 0.0, atol=0.12)
    np.testing.assert_allclose(xi.var(0) / sd**2, 1.0, atol=0.15)


def test_two_modes_keep_their_shares():
    """Gaussians of weights .8 and .2 at both ends of the box, from particles half and half."""
    prior = box([0.0, 0.0], [1.0, 1.0])
    centres = torch.tensor([[0.2, 0.3], [0.8, 0.6]], dtype=torch.float64)
    scale, share = torch.tensor([0.01, 0.02]), torch.tensor([0.8, 0.2])

    def log_likelihood(theta):
        squares = ((theta[:, None] - centres) ** 2).sum(-1) / scale**2
        return torch.logsumexp(share.log() - 2.0 * scale.log() - 0.5 * squares, dim=1)

    start = centres.repeat(400, 1)
    start = start + 0.01 * torch.randn(start.shape, generator=torch.Generator().manual_seed(0))
    found = draws_about_particles(prior, log_likelihood, start, 6000, 5)
    # The integral over the box of the two unnormalised Gaussians.
    assert found.log_evidence == pytest.approx(np.log(2.0 * np.pi), abs=0.03)
    drawn = found.resampled(3000, 0)
    assert float((drawn.theta[:, 0] < 0.5).double().mean()) == pytest.approx(0.8, abs=0.02)
    torch.testing.assert_close(drawn.log_likelihood, log_likelihood(drawn.theta))
