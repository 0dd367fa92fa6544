"""From proposals to q(z|x): what the building responds is found, and with its width."""

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from femupdate.inference.latent_search import find_latent, latent_quadratics
from femupdate.maximise import LatentData
from femupdate.surrogate import LatentMixture, Mvae, NetworkSizes

FREQUENCY = torch.arange(1, 121) / 120.0
TRUTH = (-0.9, 0.8)


class TwoSprings(torch.nn.Module):
    """Stands for a decoder: modes whose frequencies are z, floors alike in either order."""

    def __init__(self, scale):
        super().__init__()
        self.scale = scale

    def forward(self, z, points=slice(None)):
        w = FREQUENCY[points].to(z)
        omega = self.scale * (0.45 + 0.15 * z)
        terms = torch.log(
            (omega[:, :, None] ** 2 - w**2) ** 2 + (0.05 * omega[:, :, None] * w) ** 2
        )
        return -0.5 * terms.sum(1, keepdim=True)

    def excess_variance(self, points=slice(None)):
        return torch.full((1, 120), 0.03**2)[:, points]

    def damping(self, z):
        return z.new_full((len(z),), 0.02)

    def damping_coordinate(self, zeta):
        return zeta.new_zeros(len(zeta), 0)


# The decoder has learned frequencies that are half a percent off.
BUILDING, LEARNED = TwoSprings(1.0), TwoSprings(1.005)


@pytest.fixture
def mvae():
    """With a decoder that takes z as it is."""
    torch.manual_seed(0)
    made = Mvae(NetworkSizes(1, 120, 2, False, 2, width=16, parameter_width=16))
    made.decoder = LEARNED
    made.decode = LEARNED
    made.lower.fill_(0.3)
    made.upper.fill_(3.0)
    return made.requires_grad_(False)


def proposal(*places, sd=0.3):
    mean = torch.tensor([places])
    weight = torch.full((1, len(places)), -np.log(len(places)), dtype=torch.float32)
    return LatentMixture(weight, mean, torch.full_like(mean, 2.0 * np.log(sd)))


def data(truth, noise_sd, seed=0, kept=slice(None)):
    generator = torch.Generator().manual_seed(seed)
    clean = BUILDING(torch.tensor([truth], dtype=torch.float64))[0]
    noise = noise_sd * torch.randn(clean.shape, generator=generator)
    weight = torch.zeros_like(clean)
    weight[:, kept] = noise_sd**-2
    return LatentData(clean + noise, weight)


def find(mvae, seen, proposed):
    asked = []

    def respond(theta, zeta):
        root = (theta.sqrt() - 0.3**0.5) / (3.0**0.5 - 0.3**0.5)
        asked.append(len(theta))
        assert zeta.tolist() == [0.02] * len(theta)
        return BUILDING(3.0**0.5 * (2.0 * root - 1.0))

    rough = LatentData(seen.log_frf.float(), seen.weight.float())
    generator = torch.Generator().manual_seed(1)
    found = find_latent(mvae, rough, proposed, (seen, respond), generator)
    assert found.responses == sum(asked)
    return found


def test_both_solutions_are_found_from_a_poor_proposal(mvae):
    found = find(mvae, data(TRUTH, 0.05), proposal((-0.4, 0.2)))
    posterior = found
    assert len(posterior.log_weight) == 2
    # The prior of z is the same at both: so are the weights.
    np.testing.assert_allclose(posterior.log_weight.exp(), 0.5, atol=0.02)
    places = sorted(map(tuple, posterior.mean.tolist()))
    sd = np.linalg.inv(posterior.precision.numpy())[:, range(2), range(2)].max() ** 0.5
    np.testing.assert_allclose(places, sorted([TRUTH, TRUTH[::-1]]), atol=4.0 * sd)
    assert sd < 0.02
    assert found.responses < 100


def test_it_is_the_minimum_and_its_curvature_for_the_building_itself(mvae):
    """Against scipy's own least squares: what the decoder has learned wrongly does not matter."""
    seen = data(TRUTH, 0.05)
    root = seen.weight.sqrt().numpy()

    def residual(z, springs=BUILDING):
        misfit = (seen.log_frf - springs(torch.from_numpy(z)[None])[0]).numpy()
        return np.append((root * misfit).ravel(), z)

    def least(springs):
        ends = {"xtol": 1e-14, "ftol": 1e-14}
        return least_squares(residual, TRUTH, jac="3-point", kwargs={"springs": springs}, **ends)

    best = least(BUILDING)
    posterior = find(mvae, seen, proposal(TRUTH))
    row = int(np.argmin(np.linalg.norm(posterior.mean.numpy() - best.x, axis=1)))
    covariance = np.linalg.inv(best.jac.T @ best.jac)
    sd = np.sqrt(np.diag(covariance))
    # Steps end when they gain less than .02 nats; what that leaves is expanded.
    np.testing.assert_allclose(posterior.mean[row].numpy(), best.x, atol=0.02 * sd.min())
    np.testing.assert_allclose(np.linalg.inv(posterior.precision[row]), covariance, rtol=0.03)
    assert np.abs((least(LEARNED).x - best.x) / sd).max() > 1.0


def test_noise_and_gaps_make_it_wider(mvae):
    sds = []
    for noise, kept in ((0.05, slice(None)), (0.1, slice(None)), (0.1, slice(0, 60))):
        found = find(mvae, data(TRUTH, noise, kept=kept), proposal(TRUTH, TRUTH[::-1]))
        row = int(found.log_weight.argmax())
        sds.append(np.linalg.inv(found.precision[row].numpy()).trace() ** 0.5)
    assert sds[1] == pytest.approx(2.0 * sds[0], rel=0.1)
    assert sds[2] > 1.2 * sds[1]


def test_misfit_is_about_one_where_the_building_can_and_large_where_it_cannot(mvae):
    seen = data(TRUTH, 0.1)
    # 120 points less two coordinates: sd of the mean square is sqrt(2 / 120).
    usual = find(mvae, seen, proposal(TRUTH)).misfit
    assert usual == pytest.approx(1.0, abs=4 * (2 / 120) ** 0.5)
    strange = LatentData(seen.log_frf + torch.sin(40.0 * FREQUENCY), seen.weight)
    assert find(mvae, strange, proposal(TRUTH)).misfit > 10.0


def test_what_lies_beyond_the_box_is_expanded_from_its_edge(mvae):
    """Frequencies that only a z outside the prior's box has: inside, the likelihood still falls
    away from that corner as fast as the building's own does."""
    seen = data((2.1, 2.0), 0.05)
    posterior = find(mvae, seen, proposal((2.1, 2.0)))
    likelihood = latent_quadratics(posterior, 1e-9 * torch.eye(2))
    edge = 3.0**0.5
    z = torch.tensor([[edge, edge], [edge, edge - 0.02], [edge - 0.03, edge - 0.03]]).double()
    exact = -0.5 * (seen.weight * (seen.log_frf - BUILDING(z)) ** 2).sum((1, 2))
    found = likelihood(z.float()).double()
    drop, expected = found[0] - found[1:], exact[0] - exact[1:]
    assert float(expected.min()) > 5.0
    np.testing.assert_allclose(drop, expected, rtol=0.35)
