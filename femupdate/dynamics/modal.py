"""Modes as the few numbers that a frequency response needs, and the sum over them."""

from dataclasses import dataclass

import torch
from torch import Tensor

# How far above the grid's top a mode must lie to be replaced by its power series.
_ABOVE = 1.05
SERIES_TERMS = 3
CACHED = 2**16  # numbers in one intermediate array
_FEWEST = 512  # frequencies at a time
_SLOWEST = 1e-6  # rad/s: what an unstable structure would divide by zero by


@dataclass(frozen=True)
class ModalData:
    """What the FRFs of N parameter samples need, for any damping and any frequency grid.

    H_f(w) = 1 + sum_j effect[f, j] w^2 / (w_j^2 - w^2 + 2 i zeta_j w_j w)
               + sum_k residual[f, k] w^(2 k + 2),
    where the second sum is the rest of the modes, all far above the grid, by their power series.

    Attributes:
        omega: (N, m) circular frequencies, rad/s.
        effect: (N, f, m) floor shape times participation factor of each mode.
        residual: (N, f, t) first terms of the power series of the modes left out, s^2, s^4, ...
    """

    omega: Tensor
    effect: Tensor
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
            omega: (k,) rad/s.
            ratio: (N, m) damping ratios of the modes.
        """
        inverse = self.omega.clamp_min(_SLOWEST) ** -2
        real, imaginary = modal_sum(inverse, ratio, self.effect * inverse[:, None, :], omega)
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
        omega: (k,) rad/s.
    """
    # Arrays of all modes at all frequencies are by far the largest: some frequencies at a time, so
    # that they stay in the processor's cache.
    width = max(_FEWEST, CACHED // max(1, inverse.numel()))
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
        top_frequency_hz: top of the frequency grid.
    """
    if modes is None or modes >= omega.shape[1]:
        return ModalData(omega, effect, effect.new_zeros(*effect.shape[:2], SERIES_TERMS))
    if top_frequency_hz is None:
        raise ValueError("top_frequency_hz is needed to leave modes out")
    order = _importance(omega, effect, 2.0 * torch.pi * top_frequency_hz).argsort(
        dim=1, descending=True
    )
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


def _importance(omega: Tensor, effect: Tensor, top: float) -> Tensor:
    """Largest change that leaving a mode out can make to any floor's H.

    In the band that is the resonance peak, taken at a damping ratio of .01; above it what the
    first terms of the power series leave at the top of the grid.
    """
    size = effect.abs().amax(dim=1)
    ratio = top / omega.clamp_min(1e-9)
    above = ratio < 1.0 / _ABOVE
    series = ratio ** (2 * SERIES_TERMS + 2) / (1.0 - (ratio**2).clamp_max(_ABOVE**-2))
    return size * torch.where(above, series, 50.0)
