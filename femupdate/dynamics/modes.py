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

from femupdate.dynamics.modal import modal_sum

_TINY = 1e-30
# What modes far from a band of frequencies add varies smoothly there: it is summed at a few
# Chebyshev points and interpolated. A pole at 1.5 half widths from the middle leaves an error of
# 2.6^-20 of it (Trefethen, Approximation Theory and Approximation Practice, theorem 8.2).
_WIDE = 512  # frequencies
_POINTS = 20
_REACH = 1.5  # half widths


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
    terms = modes.inverse, ratio, pairs
    if len(omega) <= _POINTS:
        total = torch.complex(*modal_sum(*terms, omega))
    else:
        bands = _bands(omega.numpy().tobytes())
        near = _near(modes.inverse, bands)
        parts = [_in_band(terms, *one) for one in zip(bands, *near, strict=True)]
        total = torch.cat(parts, dim=-1)
    return total.reshape(count, outputs, columns.shape[1], len(omega))


@dataclass(frozen=True, eq=False)
class _Band:
    """Neighbouring frequencies of a grid.

    Attributes:
        omega: (k,) rad/s.
        ends: below and above which, rad/s, a mode lies far from them.
        points: (q,) Chebyshev points of the band, rad/s.
        weights: (q, k) with which values there give those at the frequencies.
    """

    omega: Tensor
    ends: tuple[float, float]
    points: Tensor
    weights: Tensor


@lru_cache(maxsize=8)
def _bands(grid: bytes) -> tuple[_Band, ...]:
    """The bands of a grid (k,), rad/s, as bytes: one grid serves many responses."""
    return tuple(_band(own) for own in torch.from_numpy(np.frombuffer(grid).copy()).split(_WIDE))


def _band(omega: Tensor) -> _Band:
    low, high = float(omega.min()), float(omega.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), _TINY)
    ends = max(middle - _REACH * half, 0.0), middle + _REACH * half
    points, transform = _chebyshev()
    basis = chebyshev.chebvander((omega.numpy() - middle) / half, _POINTS - 1)
    nodes = torch.from_numpy(middle + half * points)
    return _Band(omega, ends, nodes, torch.from_numpy(transform @ basis.T))


def _near(inverse: Tensor, bands: Sequence[_Band]) -> tuple[list[int], list[int]]:
    """First and one after the last of the modes (N, m) that are summed at all of each band."""
    ends = inverse.new_tensor([band.ends for band in bands])  # (b, 2)
    before = (inverse[:, :, None, None] * ends.square() > 1.0).sum(dim=1)  # (N, b, 2)
    return before[..., 0].amin(dim=0).tolist(), before[..., 1].amax(dim=0).tolist()


def _in_band(terms: tuple[Tensor, Tensor, Tensor], band: _Band, first: int, last: int) -> Tensor:
    """Complex sums (N, p, k) of the terms of `modal_sum` in a band; some modes lie near it."""
    far = [_without(part, first, last) for part in terms]
    near = [part[..., first:last] for part in terms]
    rest = modal_sum(far[0], far[1], far[2], band.points)
    own = modal_sum(near[0], near[1], near[2], band.omega)
    return torch.complex(own[0] + rest[0] @ band.weights, own[1] + rest[1] @ band.weights)


def _without(values: Tensor, first: int, last: int) -> Tensor:
    """Values (..., m) but for those from one to before another."""
    if first == 0:
        return values[..., last:]
    return torch.cat([values[..., :first], values[..., last:]], dim=-1)


@lru_cache(maxsize=1)
def _chebyshev() -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points (q,), and coefficients (q, q) of the polynomial that is 1 at one of them."""
    points = chebyshev.chebpts1(_POINTS)
    return points, np.linalg.inv(chebyshev.chebvander(points, _POINTS - 1)).T
