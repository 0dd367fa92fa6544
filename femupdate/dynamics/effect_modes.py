"""Modes of a reduced structure with effects, and the response that they add up to.

Shapes are of unit modal stiffness, so that coordinates without mass or on rigid springs (a rigid
ground) have modes of zero 1 / omega^2, not of infinite frequency.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from numpy.polynomial import chebyshev
from torch import Tensor

_TINY = 1e-30
# What modes far above the grid's top add varies smoothly over the grid: it is summed at a few
# Chebyshev points and interpolated, with an error of 2.6^-20 of it (a pole at 1.25 times the top).
_ABOVE = 1.25
_POINTS = 20
_ROOM = 2**17  # numbers in one intermediate array: it stays in the processor's cache


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of unit modal stiffness, m of them.

    Attributes:
        inverse: (N, m) 1 / omega^2, largest first.
        ratio: (N, m) damping ratios.
        rows: (N, o, m) displacement of floors and, after them, ports.
        participation: (N, m) modal force per unit base acceleration.
        direct: (N, o) rigid motion of floors and ports per unit base translation.
        floors: how many of the rows are floors.
    """

    inverse: Tensor
    ratio: Tensor
    rows: Tensor
    participation: Tensor
    direct: Tensor
    floors: int

    @property
    def frequency_hz(self) -> Tensor:
        """(N, m) natural frequencies."""
        return natural(self.inverse) / (2.0 * torch.pi)

    def __getitem__(self, samples: slice) -> "Modes":
        return Modes(
            self.inverse[samples],
            self.ratio[samples],
            self.rows[samples],
            self.participation[samples],
            self.direct[samples],
            self.floors,
        )


def natural(inverse: Tensor) -> Tensor:
    """Circular frequencies (N, m), huge where a mode has no mass."""
    return inverse.clamp_min(_TINY).rsqrt()


def normal_modes(stiffness: Tensor, mass: Tensor | None, sides: Tensor) -> tuple[Tensor, Tensor]:
    """What shapes of unit modal stiffness show of some vectors, and 1 / omega^2.

    Args:
        stiffness: (N, r, r) positive definite.
        mass: (N, r, r), or None for the identity.
        sides: (N, s, r) vectors.

    Returns:
        (N, s, r) the vectors' products with the shapes, and (N, r), largest first.
    """
    if mass is None:
        squared, vectors = torch.linalg.eigh(stiffness)
        return (sides @ vectors) * squared.rsqrt()[:, None, :], 1.0 / squared
    factor = torch.linalg.cholesky(stiffness)
    half = torch.linalg.solve_triangular(factor, mass, upper=False)
    flexibility = torch.linalg.solve_triangular(factor, half.mT, upper=False)
    inverse, vectors = torch.linalg.eigh(flexibility)
    seen = torch.linalg.solve_triangular(factor, sides.mT, upper=False)
    return (seen.mT @ vectors).flip(-1), inverse.flip(-1).clamp_min(0.0)


def response(modes: Modes, omega: Tensor, port_stiffness: Sequence[Tensor]) -> Tensor:
    """Complex FRFs (N, f, k): absolute acceleration of the floors over that of the base.

    Args:
        modes: of the structure without what acts in its ports.
        omega: (k,) rad/s.
        port_stiffness: (N, k) complex dynamic stiffness in each port, N/m.
    """
    flexible = _receptance(modes, omega)
    squared, floors = omega**2, modes.floors
    # Absolute displacements times -omega^2, per unit base acceleration.
    free = modes.direct[:, :, None] + squared * flexible[:, :, 0]
    if not port_stiffness:
        return free
    stiffness = torch.stack(list(port_stiffness), dim=1)  # (N, j, k)
    moved = _with_ports(flexible[:, floors:, 1:], stiffness, free[:, floors:])
    forces = stiffness * moved
    return free[:, :floors] - torch.einsum("nfjk,njk->nfk", flexible[:, :floors, 1:], forces)


def _with_ports(between: Tensor, stiffness: Tensor, free: Tensor) -> Tensor:
    """Motion (N, j, k) of the ports under the forces in them, from that without, (N, j, k).

    `between` (N, j, j, k) is what a force in one port moves at another one.
    """
    if free.shape[1] == 1:
        return free / (1.0 + between[:, 0] * stiffness)
    eye = torch.eye(free.shape[1], dtype=free.dtype)
    system = eye + (between * stiffness[:, None]).permute(0, 3, 1, 2)
    return torch.linalg.solve(system, free.mT[..., None])[..., 0].mT


def _receptance(modes: Modes, omega: Tensor) -> Tensor:
    """Displacement (N, o, c, k) of the rows under unit base acceleration and forces in the ports.

    Two real sums are faster than a complex one.
    """
    count, outputs, size = modes.rows.shape
    columns = torch.cat([modes.participation[:, None, :], modes.rows[:, modes.floors :]], dim=1)
    pairs = (modes.rows[:, :, None, :] * columns[:, None, :, :]).reshape(count, -1, size)
    near = _near(modes.inverse, omega)
    parts = []
    for start in range(0, count, step := max(1, _ROOM // (near * len(omega)))):
        own = slice(start, start + step)
        inverse, ratio, pair = modes.inverse[own], modes.ratio[own], pairs[own]
        real, imaginary = _summed(inverse[:, :near], ratio[:, :near], pair[..., :near], omega)
        if near < size:
            low, high = float(omega.min()), float(omega.max())
            points, weights = _interpolation(low, high, omega)
            far = _summed(inverse[:, near:], ratio[:, near:], pair[..., near:], points)
            real, imaginary = real + far[0] @ weights, imaginary + far[1] @ weights
        parts.append(torch.complex(real, imaginary))
    return torch.cat(parts).reshape(count, outputs, columns.shape[1], len(omega))


def _near(inverse: Tensor, omega: Tensor) -> int:
    """How many modes, the lowest, are summed at every frequency."""
    if len(omega) <= _POINTS:
        return inverse.shape[1]
    top = _ABOVE * float(omega.max())
    return max(1, int((inverse > top**-2).sum(dim=1).max()))


def _summed(inverse: Tensor, ratio: Tensor, pairs: Tensor, omega: Tensor) -> tuple[Tensor, Tensor]:
    """Real and imaginary part (N, p, k) of sum_j pairs_j / (1 - w^2/w_j^2 + 2 i zeta_j w/w_j)."""
    elastic = 1.0 - inverse[:, :, None] * omega**2
    viscous = (2.0 * ratio * inverse.sqrt())[:, :, None] * omega
    size = elastic.square().addcmul_(viscous, viscous).reciprocal_()
    return pairs @ elastic.mul_(size), -(pairs @ viscous.mul_(size))


def _interpolation(low: float, high: float, omega: Tensor) -> tuple[Tensor, Tensor]:
    """Points (q,) rad/s between the lowest and the highest frequency, and weights (q, k)."""
    points, transform = _chebyshev()
    place = (2.0 * omega.numpy() - (high + low)) / (high - low)
    weights = transform @ chebyshev.chebvander(place, _POINTS - 1).T
    nodes = 0.5 * (high + low) + 0.5 * (high - low) * points
    return torch.from_numpy(nodes), torch.from_numpy(weights)


@lru_cache(maxsize=1)
def _chebyshev() -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points (q,), and coefficients (q, q) of the polynomial that is 1 at one of them."""
    points = chebyshev.chebpts1(_POINTS)
    return points, np.linalg.inv(chebyshev.chebvander(points, _POINTS - 1)).T
