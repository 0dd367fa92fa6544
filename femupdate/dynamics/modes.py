"""Modes of a reduced structure, and the response that they add up to.

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

from femupdate.dynamics.modal import CACHED, modal_sum

_TINY = 1e-30
# What modes far above the grid's top add varies smoothly over the grid: it is summed at a few
# Chebyshev points and interpolated, with an error of 2.6^-20 of it (a pole at 1.25 times the top).
_ABOVE = 1.25
_POINTS = 20


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of unit modal stiffness, m of them.

    Attributes:
        inverse: (N, m) 1 / omega^2, largest first; NaN where a structure is pushed away by a
            negative stiffness.
        rows: (N, o, m) displacement of what is observed and, after that, of the ports.
        participation: (N, m) modal force per unit base acceleration.
        direct: (N, o) rigid motion of the rows per unit base translation.
    """

    inverse: Tensor
    rows: Tensor
    participation: Tensor
    direct: Tensor

    def __getitem__(self, rows: Tensor) -> "Modes":
        parts = (self.inverse, self.rows, self.participation, self.direct)
        return Modes(*(part[rows] for part in parts))

    @property
    def omega(self) -> Tensor:
        """(N, m) circular frequencies, rad/s, huge where a mode has no mass."""
        return self.inverse.clamp_min(_TINY).rsqrt()

    @property
    def frequency_hz(self) -> Tensor:
        """(N, m) natural frequencies."""
        return self.omega / (2.0 * torch.pi)

    def stiffer(self, factor: Tensor) -> "Modes":
        """The modes with the stiffness of everything multiplied by factors (N,)."""
        root = factor.rsqrt()[:, None]
        return Modes(
            self.inverse * root.square(),
            self.rows * root[:, None],
            self.participation * root,
            self.direct,
        )

    @property
    def effect(self) -> Tensor:
        """(N, o, m) motion of the rows in modes of unit mass, times participation factor."""
        return self.rows * (self.participation * self.omega.square())[:, None, :]


def normal_modes(stiffness: Tensor, mass: Tensor | None, sides: Tensor) -> tuple[Tensor, Tensor]:
    """What shapes of unit modal stiffness show of some vectors, and 1 / omega^2.

    Args:
        stiffness: (N, r, r) positive definite; what is not gives NaN.
        mass: (N, r, r), or None for the identity.
        sides: (N, s, r) vectors.

    Returns:
        (N, s, r) the vectors' products with the shapes, and (N, r), largest first.
    """
    if mass is None:
        squared, vectors = torch.linalg.eigh(stiffness)
        squared = torch.where(squared > 0.0, squared, torch.nan)
        return (sides @ vectors) * squared.rsqrt()[:, None, :], 1.0 / squared
    factor, failed = torch.linalg.cholesky_ex(stiffness)
    sound = torch.where((failed == 0)[:, None, None], factor, torch.eye(factor.shape[-1]).to(mass))
    half = torch.linalg.solve_triangular(sound, mass, upper=False)
    flexibility = torch.linalg.solve_triangular(sound, half.mT, upper=False)
    inverse, vectors = torch.linalg.eigh(flexibility)
    seen = torch.linalg.solve_triangular(sound, sides.mT, upper=False).mT @ vectors
    inverse = torch.where((failed == 0)[:, None], inverse.clamp_min(0.0), torch.nan)
    return seen.flip(-1), inverse.flip(-1)


def response(
    modes: Modes, ratio: Tensor, omega: Tensor, port_stiffness: Sequence[Tensor]
) -> Tensor:
    """Complex FRFs (N, f, k): absolute acceleration of the rows over that of the base.

    Args:
        modes: of the structure without what acts in its ports, which are its last rows.
        ratio: (N, m) damping ratios.
        omega: (k,) rad/s.
        port_stiffness: (N, k) complex dynamic stiffness in each port, N/m.
    """
    columns = torch.cat([modes.participation[:, None, :], _ports(modes, port_stiffness)], dim=1)
    flexible = _receptance(modes, ratio, omega, columns)
    # Absolute displacements times -omega^2, per unit base acceleration.
    free = modes.direct[:, :, None] + omega**2 * flexible[:, :, 0]
    return _held(free, flexible, port_stiffness)


def force_response(
    modes: Modes, ratio: Tensor, omega: Tensor, port_stiffness: Sequence[Tensor], forced: int
) -> Tensor:
    """Complex receptance (N, f, k), m/N: displacement of the rows to a force on one of them.

    Args:
        modes, ratio, omega, port_stiffness: see `response`.
        forced: the row on which the force acts.
    """
    columns = torch.cat([modes.rows[:, forced : forced + 1], _ports(modes, port_stiffness)], dim=1)
    flexible = _receptance(modes, ratio, omega, columns)
    return _held(flexible[:, :, 0], flexible, port_stiffness)


def _ports(modes: Modes, port_stiffness: Sequence[Tensor]) -> Tensor:
    """(N, j, m) rows of the ports, which are the last."""
    return modes.rows[:, modes.rows.shape[1] - len(port_stiffness) :]


def _held(free: Tensor, flexible: Tensor, port_stiffness: Sequence[Tensor]) -> Tensor:
    """Motion (N, f, k) of the rows with what acts in the ports, from that (N, o, k) without."""
    rows = flexible.shape[1] - len(port_stiffness)
    if not port_stiffness:
        return free
    stiffness = torch.stack(list(port_stiffness), dim=1)  # (N, j, k)
    moved = _with_ports(flexible[:, rows:, 1:], stiffness, free[:, rows:])
    forces = stiffness * moved
    return free[:, :rows] - torch.einsum("nfjk,njk->nfk", flexible[:, :rows, 1:], forces)


def _with_ports(between: Tensor, stiffness: Tensor, free: Tensor) -> Tensor:
    """Motion (N, j, k) of the ports under the forces in them, from that without, (N, j, k).

    `between` (N, j, j, k) is what a force in one port moves at another one.
    """
    if free.shape[1] == 1:
        return free / (1.0 + between[:, 0] * stiffness)
    eye = torch.eye(free.shape[1], dtype=free.dtype)
    system = eye + (between * stiffness[:, None]).permute(0, 3, 1, 2)
    return torch.linalg.solve(system, free.mT[..., None])[..., 0].mT


def _receptance(modes: Modes, ratio: Tensor, omega: Tensor, columns: Tensor) -> Tensor:
    """Displacement (N, o, c, k) of all rows under loads whose modal forces are (N, c, m)."""
    count, outputs, size = modes.rows.shape
    pairs = (modes.rows[:, :, None, :] * columns[:, None, :, :]).reshape(count, -1, size)
    near = _near(modes.inverse, omega)
    points, weights = _interpolation(omega) if near < size else (omega, omega)
    parts = []
    for start in range(0, count, step := max(1, CACHED // (near * len(omega)))):
        own = slice(start, start + step)
        inverse, damping, pair = modes.inverse[own], ratio[own], pairs[own]
        real, imaginary = modal_sum(inverse[:, :near], damping[:, :near], pair[..., :near], omega)
        if near < size:
            rest = modal_sum(inverse[:, near:], damping[:, near:], pair[..., near:], points)
            real, imaginary = real + rest[0] @ weights, imaginary + rest[1] @ weights
        parts.append(torch.complex(real, imaginary))
    return torch.cat(parts).reshape(count, outputs, columns.shape[1], len(omega))


def _near(inverse: Tensor, omega: Tensor) -> int:
    """How many modes, the lowest, are summed at every frequency."""
    if len(omega) <= _POINTS:
        return inverse.shape[1]
    top = _ABOVE * float(omega.max())
    return max(1, int((inverse > top**-2).sum(dim=1).max()))


def _interpolation(omega: Tensor) -> tuple[Tensor, Tensor]:
    """Points (q,) rad/s between the lowest and the highest frequency, and weights (q, k)."""
    low, high = float(omega.min()), float(omega.max())
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
