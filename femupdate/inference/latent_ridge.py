"""Solutions that no Gaussian describes: a row of Gaussians along the ridge instead.

Where two solutions merge, the misfit is flat to the second order in one direction, and a Gaussian
with the curvature there is far too wide. From such a point steps to both sides, each put right
across the direction by Gauss-Newton, follow the ridge of the posterior density until it has fallen;
Gaussians side by side, as heavy as the ridge is high, then stand for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.interpolate import CubicSpline
from torch import Tensor

from femupdate.inference.thresholds import RIDGE
from femupdate.surrogate.gauss_newton import Descent, Residuals, nats_of


@dataclass(frozen=True, eq=False)
class _Ridge:
    """Points on a ridge, in order.

    Attributes:
        z: (n, z).
        nats: (n,).
        information: (n, z, z).
    """

    z: Tensor
    nats: Tensor
    information: Tensor


def bent(misfit: Residuals, points: Descent, reach: Tensor) -> Tensor:
    """Which solutions (s,) a Gaussian of the curvature there does not describe.

    Args:
        misfit: of the building's own responses.
        points: solutions.
        reach: (z,) largest |z| that can be asked for.
    """
    mass = points.log_mass
    found = torch.zeros(len(points.z), dtype=torch.bool)
    for row in torch.nonzero(mass > mass.amax() - RIDGE.light)[:, 0].tolist():
        axis, sd = _widest(points[[row]])
        away = min(RIDGE.tried * sd, RIDGE.furthest)
        for offset in (-away * axis, away * axis):
            tried = points.z[row : row + 1] + offset
            if bool((tried.abs() < reach).all()):
                rise = float(nats_of(misfit(tried), tried)[0] - points.nats[row])
                found[row] |= abs(rise - 0.5 * (away / sd) ** 2) > RIDGE.tolerance
    return found


def along_ridges(misfit: Residuals, points: Descent, solutions: Descent, reach: Tensor) -> Descent:
    """Gaussians along the ridges through bent solutions, each centre a point of the descent.

    A ridge ends where it comes to one of the solutions, which stand for themselves.

    Args:
        misfit: of the building's own responses.
        points: bent ones, the heaviest first.
        solutions: that are not.
        reach: (z,) largest |z| that can be asked for.
    """
    kept = solutions
    for row in range(len(points.z)):
        if not _belongs(kept, points.z[row : row + 1])[0]:
            ridge = _followed(misfit, points[[row]], kept, reach)
            short = len(ridge.z) < RIDGE.fewest
            kept = _joined(kept, points[[row]] if short else _kernels(ridge))
    return kept


def _followed(misfit: Residuals, point: Descent, solutions: Descent, reach: Tensor) -> _Ridge:
    """The ridge to both sides of a point."""
    axis, sd = _widest(point)
    best = min([float(point.nats[0]), *solutions.nats.tolist()])
    step = min(RIDGE.first * sd, RIDGE.longest)
    sides = [
        _side(misfit, point, (sign * axis, step), best, solutions, reach) for sign in (-1.0, 1.0)
    ]
    back = [side.flip(0) for side in sides[0]]
    start = (point.z, point.nats, point.information)
    return _Ridge(*(torch.cat(parts) for parts in zip(back, start, sides[1], strict=True)))


def _side(
    misfit: Residuals,
    point: Descent,
    start: tuple[Tensor, float],
    best: float,
    solutions: Descent,
    reach: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    """Points, nats and information on one side of a point, itself left out.

    `start` is the first direction and step.
    """
    found: list[tuple[Tensor, Tensor, Tensor]] = []
    here, nats, (direction, step) = point.z, float(point.nats[0]), start
    for _ in range(RIDGE.steps):
        ahead = here + step * direction
        if bool((ahead.abs() > reach).any()):
            break
        ahead, there, information = _pulled_back(misfit, ahead, direction)
        change = abs(float(there) - nats)
        if change > RIDGE.change and step > RIDGE.shortest:
            step = max(0.5 * step, RIDGE.shortest)
            continue
        if _belongs(solutions, ahead)[0]:
            break
        found.append((ahead, there, information))
        moved = (ahead - here)[0]
        here, nats, direction = ahead, float(there), moved / moved.norm()
        best = min(best, nats)
        if nats > best + RIDGE.fallen:
            break
        if change < 0.25 * RIDGE.change:
            step = min(1.5 * step, RIDGE.longest)
    if not found:
        empty = point.z.new_zeros(0)
        return point.z[:0], empty, point.information[:0]
    z, levels, informations = zip(*found, strict=True)
    return torch.cat(z), torch.cat(levels), torch.cat(informations)


def _pulled_back(misfit: Residuals, z: Tensor, direction: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The best point near z (1, z) across a direction, its nats (1,) and information (1, z, z)."""
    identity = torch.eye(z.shape[1]).to(z)
    along = torch.outer(direction, direction)
    across = identity - along
    residual = misfit(z)
    jacobian = misfit.derivative(z, residual)[0]
    information = jacobian.T @ jacobian
    stiff = across @ (information + identity) @ across + along
    for _ in range(RIDGE.pull_backs):
        slope = across @ (jacobian.T @ residual[0] - z[0])
        z = z + across @ torch.linalg.solve(stiff, slope)
        residual = misfit(z)
    return z, nats_of(residual, z), information[None]


def _widest(point: Descent) -> tuple[Tensor, float]:
    """Direction (z,) in which the density at a point is widest, and its standard deviation."""
    precision = point.information[0] + torch.eye(point.z.shape[1]).to(point.z)
    values, vectors = torch.linalg.eigh(precision)
    return vectors[:, 0], float(values[0]) ** -0.5


def _kernels(ridge: _Ridge) -> Descent:
    """Gaussians side by side along a ridge, from splines through its points."""
    place = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ridge.z, axis=0), axis=1))])
    curve = CubicSpline(place, ridge.z.numpy())
    height = CubicSpline(place, ridge.nats.numpy())
    ups_and_downs = float(np.abs(np.diff(ridge.nats)).sum())
    count = min(int(np.ceil(RIDGE.kernels * ups_and_downs)) + 1, RIDGE.most_kernels)
    spacing = place[-1] / count
    middles = spacing * (np.arange(count) + 0.5)
    tangent = curve(middles, 1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    nearest = np.abs(place[:, None] - middles).argmin(axis=0)
    sd = min(RIDGE.kernel_width * spacing, 1.0)
    information = _with_tangent(ridge.information[nearest], torch.from_numpy(tangent), sd)
    # The mass of a Gaussian is that of its stretch of the ridge.
    nats = torch.from_numpy(height(middles)) + np.log(np.sqrt(2.0 * np.pi) * sd / spacing)
    z = torch.from_numpy(curve(middles))
    return Descent(z, nats, information, z.clone())


def _with_tangent(information: Tensor, tangent: Tensor, sd: float) -> Tensor:
    """Information (n, z, z) of which the part along tangents (n, z) gives a standard deviation."""
    along = tangent[:, :, None] * tangent[:, None]
    across = torch.eye(tangent.shape[1]).to(tangent) - along
    return across @ information @ across + (sd**-2 - 1.0) * along


def _belongs(solutions: Descent, z: Tensor) -> Tensor:
    """Which of the points (n, z) are near a solution."""
    if len(solutions.z) == 0:
        return torch.zeros(len(z), dtype=torch.bool)
    identity = torch.eye(z.shape[1]).to(z)
    offset = z[:, None] - solutions.z
    squares = torch.einsum("nci,cij,ncj->nc", offset, solutions.information + identity, offset)
    return (squares < RIDGE.near**2).any(dim=1)


def _joined(*parts: Descent) -> Descent:
    fields: Sequence[Tensor] = [
        torch.cat(values)
        for values in zip(*((p.z, p.nats, p.information, p.pull) for p in parts), strict=True)
    ]
    return Descent(*fields)
