"""From proposals to q(z|x): what the building responds is found, and with its width."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares
from torch import Tensor

from femupdate.inference.latent_search import along_ridges, bent, find_latent, latent_quadratics
from femupdate.maximise import Descent, LatentData, Residuals, descend, misfit_of
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


REACH = torch.full((2,), 2.25, dtype=torch.float64)
Residual = Callable[[Tensor], Tensor]


def fold(z: Tensor) -> Tensor:
    """Two solutions that have merged: flat to the second order, and not along one axis."""
    along, across = z[:, 0] + 0.5 * z[:, 1], z[:, 1] - 0.5 * z[:, 0]
    return torch.stack([(along - 0.4) ** 2 / 0.04, (across - 0.3) / 0.01], dim=1)


def two_near(z: Tensor) -> Tensor:
    """Two solutions with a saddle of about half a nat between them."""
    return torch.stack([((z[:, 0] - 0.2) ** 2 - 0.02) / 0.019, (z[:, 1] - z[:, 0]) / 0.02], dim=1)


def banana(z: Tensor) -> Tensor:
    """A solution whose ridge bends by several of its widths."""
    return torch.stack([(z[:, 0] + 0.5) / 0.15, (z[:, 1] - 2.0 * z[:, 0] ** 2) / 0.01], dim=1)


def broad(z: Tensor) -> Tensor:
    """A solution that is about as wide in two directions, and no Gaussian."""
    u, v = (z[:, 0] - 0.3) / 0.05, (z[:, 1] - 0.2) / 0.06
    return torch.stack([u + 0.5 * v**2, v + 0.5 * u**2], dim=1)


def straight(z: Tensor) -> Tensor:
    """A Gaussian."""
    return torch.stack([(z[:, 0] - 0.5) / 0.05, (z[:, 1] + z[:, 0]) / 0.01], dim=1)


def _misfit(residual: Residual) -> Residuals:
    """A misfit whose residuals are minus these."""
    zero = torch.zeros(1, 2, dtype=torch.float64)
    data = LatentData(zero, torch.ones_like(zero))
    return misfit_of(lambda z: residual(z)[:, None], data, 1e-5)


def _solution(misfit: Residuals, start: tuple[float, float]) -> Descent:
    return descend(misfit, torch.tensor([start], dtype=torch.float64))


def _by_quadrature(residual: Residual) -> tuple[float, np.ndarray, np.ndarray]:
    """Log mass, mean and standard deviations of exp(-(r^2 + z^2) / 2), by a fine grid."""
    grid = torch.linspace(-2.25, 2.25, 1201, dtype=torch.float64)
    z = torch.cartesian_prod(grid, grid)
    logs = -0.5 * (residual(z).square().sum(1) + z.square().sum(1))
    share = torch.softmax(logs, 0)
    mean = share @ z
    variance = share @ (z - mean) ** 2
    cell = float(grid[1] - grid[0]) ** 2
    return float(logs.logsumexp(0)) + np.log(cell), mean.numpy(), variance.sqrt().numpy()


def _of_mixture(found: Descent) -> tuple[float, np.ndarray, np.ndarray]:
    mass = found.log_mass
    share = torch.softmax(mass, 0)
    covariance = torch.linalg.inv(found.information + torch.eye(2).double())
    mean = share @ found.z
    spread = covariance.diagonal(dim1=1, dim2=2) + (found.z - mean) ** 2
    # log_mass leaves out the factor 2 pi to the half of the dimension.
    return (
        float(mass.logsumexp(0)) + np.log(2 * np.pi),
        mean.numpy(),
        (share @ spread).sqrt().numpy(),
    )


@pytest.mark.parametrize(
    ("residual", "start"), [(fold, (0.2, 0.4)), (two_near, (0.35, 0.35)), (banana, (-0.4, 0.3))]
)
def test_a_row_of_gaussians_has_mass_and_moments_of_the_density(
    residual: Residual, start: tuple[float, float]
) -> None:
    misfit = _misfit(residual)
    point = _solution(misfit, start)
    assert bool(bent(misfit, point, REACH)[0])
    found = along_ridges(misfit, point, point[[]], REACH)
    mass, mean, sd = _of_mixture(found)
    true_mass, true_mean, true_sd = _by_quadrature(residual)
    # A few per cent: the ridge is cut where it has fallen by eight nats, and across it the density
    # is taken as Gaussian. By the curvature alone the fold is wrong by a factor of five.
    assert mass == pytest.approx(true_mass, abs=0.06)
    np.testing.assert_allclose(sd, true_sd, rtol=0.06)
    assert np.all(np.abs(mean - true_mean) < 0.06 * true_sd)


def test_a_maximum_as_wide_in_two_directions_has_no_ridge() -> None:
    misfit = _misfit(broad)
    point = _solution(misfit, (0.3, 0.2))
    assert bool(bent(misfit, point, REACH)[0])
    found = along_ridges(misfit, point, point[[]], REACH)
    # A way that is followed in circles has 56 Gaussians, of twice the mass.
    assert len(found.z) == 1
    assert _of_mixture(found)[0] == pytest.approx(_by_quadrature(broad)[0], abs=0.06)


def test_a_gaussian_solution_is_left_as_it_is() -> None:
    misfit = _misfit(straight)
    assert not bent(misfit, _solution(misfit, (0.3, -0.2)), REACH)[0]
