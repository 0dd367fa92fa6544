"""Bent and merging solutions: a row of Gaussians has the mass and the moments of the density."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from femupdate.inference.latent_search import along_ridges, bent
from femupdate.maximise import Descent, LatentData, Residuals, descend, misfit_of

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
