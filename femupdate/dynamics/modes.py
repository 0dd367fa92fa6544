"""Modes of a structure, and the responses that they add up to.

Shapes are of unit modal stiffness, so that coordinates without mass or on rigid springs (a rigid
ground) have modes of zero 1 / omega^2, not of infinite frequency. `ModalData` is what a response to
a base that translates needs of them, for any damping and any frequency grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from numpy.polynomial import chebyshev
from torch import Tensor

# How far above the grid's top a mode must lie to be replaced by its power series.
_ABOVE = 1.05
SERIES_TERMS = 3
_TINY = 1e-30
# What modes far from a band of frequencies add varies smoothly there: it is summed at a few
# Chebyshev points and interpolated. A pole at 1.5 half widths from the middle leaves an error of
# 2.6^-20 of it (Trefethen, Approximation Theory and Approximation Practice, theorem 8.2).
_POINTS = 20
_REACH = 1.5  # half widths


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of unit modal stiffness, m of them."""

    # (N, m) 1 / omega^2, largest first; NaN where a structure is pushed away by a negative
    # stiffness
    inverse: Tensor
    rows: Tensor  # (N, o, m) displacement of what is observed and, after that, of the ports
    # (N, e, m) modal force per unit acceleration of the base, in each column of its motion
    participation: Tensor
    direct: Tensor  # (N, o, e) rigid motion of the rows with the base

    def __getitem__(self, rows: Tensor | slice) -> "Modes":
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

    @property
    def effect(self) -> Tensor:
        """(N, o, m) motion of the rows in modes of unit mass, times that of translation."""
        return self.rows * (self.participation[:, :1] * self.omega.square()[:, None])


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
        if len(stiffness) > 1 or stiffness.requires_grad or stiffness.is_cuda:
            squared, vectors = torch.linalg.eigh(stiffness)
        else:
            squared, vectors = once_solved(stiffness.shape, stiffness.numpy().tobytes())
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


@lru_cache(maxsize=8)
def once_solved(shape: tuple[int, ...], stiffness: bytes) -> tuple[Tensor, Tensor]:
    """Eigenvalues and vectors of a matrix that most effects leave as it is."""
    matrix = np.frombuffer(stiffness).reshape(shape).copy()
    return torch.linalg.eigh(torch.from_numpy(matrix))


def response(
    modes: Modes,
    ratio: Tensor,
    omega: Tensor,
    port_stiffness: Sequence[Tensor],
    *,
    columns: int = 1,
    forced: int | None = None,
) -> Tensor:
    """Complex FRFs (N, f, e, k): absolute acceleration of the rows per unit of every excitation.

    Args:
        modes: of the structure without what acts in its ports, which are its last rows.
        ratio: (N, m) damping ratios.
        port_stiffness: (N, k) complex dynamic stiffness in each port, N/m.
        columns: of the base's motion that are wanted (see `Excitation`).
        forced: the row on which a force acts in place of that.
    """
    rows = modes.rows.shape[1] - len(port_stiffness)
    if forced is None:
        loads, rigid = modes.participation[:, :columns], modes.direct[:, :, :columns, None]
    else:
        loads, rigid = -modes.rows[:, forced : forced + 1], modes.direct.new_zeros(1, 1, 1, 1)
    # Displacements (N, o, c, k) of all rows under loads of these modal forces.
    acting, (count, outputs, size) = torch.cat([loads, modes.rows[:, rows:]], 1), modes.rows.shape
    pairs = (modes.rows[:, :, None, :] * acting[:, None, :, :]).reshape(count, -1, size)
    total = torch.complex(*_summed(modes.inverse, ratio, pairs, omega))
    flexible = total.reshape(count, outputs, acting.shape[1], len(omega))
    # Absolute displacements times -omega^2.
    free = rigid + omega**2 * flexible[:, :, : loads.shape[1]]
    if not port_stiffness:
        return free
    stiffness = torch.stack(list(port_stiffness), dim=1)  # (N, j, k)
    between = flexible[:, :, loads.shape[1] :]  # what a force in a port moves
    forces = stiffness[:, :, None] * _with_ports(between[:, rows:], stiffness, free[:, rows:])
    return free[:, :rows] - torch.einsum("nfjk,njek->nfek", between[:, :rows], forces)


def _with_ports(between: Tensor, stiffness: Tensor, free: Tensor) -> Tensor:
    """Motion (N, j, e, k) of the ports under the forces in them, from that without."""
    if free.shape[1] == 1:
        return free / (1.0 + between * stiffness[:, None])
    eye = torch.eye(free.shape[1], dtype=free.dtype)
    system = eye + (between * stiffness[:, None]).permute(0, 3, 1, 2)
    return torch.linalg.solve(system, free.permute(0, 3, 1, 2)).permute(0, 2, 3, 1)


def _summed(inverse: Tensor, ratio: Tensor, pairs: Tensor, omega: Tensor) -> tuple[Tensor, Tensor]:
    """`modal_sum` of modes in the order of their frequencies, lowest first."""
    terms = inverse, ratio, pairs
    if len(omega) <= _POINTS or inverse.shape[1] <= _POINTS:
        return modal_sum(*terms, omega)
    bands = _bands(omega.numpy().tobytes())
    # First and one after the last of the modes that are summed at all of each band.
    ends = inverse.new_tensor([band.ends for band in bands])  # (b, 2)
    before = (inverse[:, :, None, None] * ends.square() > 1.0).sum(dim=1)  # (N, b, 2)
    near = before[..., 0].amin(dim=0).tolist(), before[..., 1].amax(dim=0).tolist()
    real, imaginary = [], []
    for band, first, last in zip(bands, *near, strict=True):
        beyond = [torch.cat([part[..., :first], part[..., last:]], dim=-1) for part in terms]
        within = [part[..., first:last] for part in terms]
        far = modal_sum(beyond[0], beyond[1], beyond[2], band.points)
        inside = modal_sum(within[0], within[1], within[2], band.omega)
        real.append(inside[0] + far[0] @ band.weights)
        imaginary.append(inside[1] + far[1] @ band.weights)
    return torch.cat(real, dim=-1), torch.cat(imaginary, dim=-1)


@dataclass(frozen=True, eq=False)
class _Band:
    """Neighbouring frequencies of a grid."""

    omega: Tensor  # (k,) rad/s
    ends: tuple[float, float]  # below and above which, rad/s, a mode lies far from them
    points: Tensor  # (q,) Chebyshev points of the band, rad/s
    weights: Tensor  # (q, k) with which values there give those at the frequencies


@lru_cache(maxsize=8)
def _bands(grid: bytes) -> tuple[_Band, ...]:
    """The bands of a grid (k,), rad/s, as bytes: one grid serves many responses."""
    chebyshev_points = chebyshev.chebpts1(_POINTS)
    # Coefficients (q, q) of the polynomial that is 1 at one of the points.
    transform = np.linalg.inv(chebyshev.chebvander(chebyshev_points, _POINTS - 1)).T
    bands = []
    for omega in torch.from_numpy(np.frombuffer(grid).copy()).split(512):
        low, high = float(omega.min()), float(omega.max())
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), _TINY)
        ends = max(middle - _REACH * half, 0.0), middle + _REACH * half
        basis = chebyshev.chebvander((omega.numpy() - middle) / half, _POINTS - 1)
        nodes = torch.from_numpy(middle + half * chebyshev_points)
        bands.append(_Band(omega, ends, nodes, torch.from_numpy(transform @ basis.T)))
    return tuple(bands)


@dataclass(frozen=True)
class ModalData:
    """What the FRFs of N parameter samples need, for any damping and any frequency grid.

    H_f(w) = 1 + sum_j effect[f, j] w^2 / (w_j^2 - w^2 + 2 i zeta_j w_j w)
               + sum_k residual[f, k] w^(2 k + 2),
    where the second sum is the rest of the modes, all far above the grid, by their power series.
    """

    omega: Tensor  # (N, m) circular frequencies, rad/s
    effect: Tensor  # (N, f, m) floor shape times participation factor of each mode
    # (N, f, t) first terms of the power series of the modes left out, s^2, s^4, ..
    residual: Tensor

    def __len__(self) -> int:
        return self.omega.shape[0]

    def __getitem__(self, rows: Tensor | slice) -> "ModalData":
        return ModalData(self.omega[rows], self.effect[rows], self.residual[rows])

    def to(self, device: torch.device | str, dtype: torch.dtype | None = None) -> "ModalData":
        """The same data on another device or in another precision."""
        moved = (t.to(device=device, dtype=dtype) for t in (self.omega, self.effect, self.residual))
        return ModalData(*moved)

    def of_floors(self, rows: list[int]) -> "ModalData":
        """The same data of some floors."""
        return ModalData(self.omega, self.effect[:, rows], self.residual[:, rows])

    def response(self, omega: Tensor, ratio: Tensor) -> tuple[Tensor, Tensor]:
        """Real and imaginary part of H (N, f, k).

        Args:
            ratio: (N, m) damping ratios of the modes.
        """
        # An unstable structure would divide by zero.
        inverse = self.omega.clamp_min(1e-6) ** -2
        # Those that a network gives are in single precision, with gradients, or in no order.
        of_solver = inverse.dtype == torch.float64 and inverse.device.type == "cpu"
        ordered = of_solver and not inverse.requires_grad and bool((inverse.diff() <= 0.0).all())
        add = _summed if ordered else modal_sum
        real, imaginary = add(inverse, ratio, self.effect * inverse[:, None, :], omega)
        squared = omega**2
        powers = torch.stack([squared ** (k + 1) for k in range(self.residual.shape[-1])])
        return 1.0 + squared * real + self.residual @ powers, squared * imaginary


def joined(parts: list[ModalData]) -> ModalData:
    """Data of consecutive samples as one."""
    return ModalData(
        torch.cat([part.omega for part in parts]),
        torch.cat([part.effect for part in parts]),
        torch.cat([part.residual for part in parts]),
    )


def modal_sum(
    inverse: Tensor, ratio: Tensor, pairs: Tensor, omega: Tensor
) -> tuple[Tensor, Tensor]:
    """Real and imaginary part (N, p, k) of sum_j pairs_j / (1 - w^2/w_j^2 + 2 i zeta_j w/w_j).

    Two real sums are faster than a complex one.

    Args:
        inverse: (N, m) 1 / omega_j^2.
        ratio: (N, m) damping ratios.
        pairs: (N, p, m) static displacement of an output in each mode.
    """
    # Arrays of all modes at all frequencies are by far the largest: some frequencies at a time, so
    # that they stay in the processor's cache.
    # Fewer frequencies at a time would only cost calls.
    width = max(512, 2**16 // max(1, inverse.numel()))
    if omega.numel() > width:
        parts = [modal_sum(inverse, ratio, pairs, some) for some in omega.split(width)]
        real, imaginary = zip(*parts, strict=True)
        return torch.cat(real, dim=-1), torch.cat(imaginary, dim=-1)
    elastic = torch.addcmul(omega.new_ones(1), inverse[:, :, None], omega.square(), value=-1.0)
    viscous = (-2.0 * ratio * inverse.sqrt())[:, :, None] * omega
    if elastic.requires_grad or viscous.requires_grad:  # gradients need what is between
        size = (elastic.square() + viscous.square()).reciprocal()
        return torch.bmm(pairs, elastic * size), torch.bmm(pairs, viscous * size)
    size = elastic.square().addcmul_(viscous, viscous).reciprocal_()
    return torch.bmm(pairs, elastic.mul_(size)), torch.bmm(pairs, viscous.mul_(size))


def keep_modes(
    omega: Tensor, effect: Tensor, modes: int | None, top_frequency_hz: float | None
) -> ModalData:
    """Keep the modes that matter most; the others, taken as stiff, go to the power series.

    Args:
        omega: (N, r) rad/s.
        effect: (N, f, r) floor shape times participation factor.
    """
    if modes is None or modes >= omega.shape[1]:
        return ModalData(omega, effect, effect.new_zeros(*effect.shape[:2], SERIES_TERMS))
    if top_frequency_hz is None:
        raise ValueError("top_frequency_hz is needed to leave modes out")
    # What leaving a mode out can change at most of any floor's H. In the band that is the resonance
    # peak, at a damping ratio of .01; above it the series' rest.
    ratio = 2.0 * torch.pi * top_frequency_hz / omega.clamp_min(1e-9)
    rest = ratio ** (2 * SERIES_TERMS + 2) / (1.0 - (ratio**2).clamp_max(_ABOVE**-2))
    most = effect.abs().amax(dim=1) * torch.where(ratio < 1.0 / _ABOVE, rest, 50.0)
    order = most.argsort(dim=1, descending=True)
    kept = order[:, :modes].sort(dim=1).values
    left = order[:, modes:]
    omega_left = omega.gather(1, left)
    effect_left = effect.gather(2, left[:, None, :].expand(-1, effect.shape[1], -1))
    # A mode inside the band whose effect is negligible must not enter the series: it diverges.
    stiff = omega_left > _ABOVE * 2.0 * torch.pi * top_frequency_hz
    weights = torch.where(stiff, 1.0 / omega_left.clamp_min(1e-9) ** 2, 0.0)
    powers = torch.stack([weights ** (k + 1) for k in range(SERIES_TERMS)], dim=-1)
    return ModalData(
        omega.gather(1, kept),
        effect.gather(2, kept[:, None, :].expand(-1, effect.shape[1], -1)),
        effect_left @ powers,
    )
