"""Modes of the reduced model for many theta at once, and the few numbers that a FRF needs."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from femupdate.dynamics.reduced import ReducedModel
from femupdate.progress import SILENT, Progress

# How far above the grid's top a mode must lie to be replaced by its power series.
_ABOVE = 1.05
SERIES_TERMS = 3


@dataclass(frozen=True)
class ModalData:
    """What the FRFs of N parameter samples need, for any damping and any frequency grid.

    H_f(w) = 1 + sum_j effect[f, j] w^2 / (w_j^2 - w^2 + 2 i zeta_j w_j w)
               + sum_k residual[f, k] w^(2 k + 2),
    where the second sum is the rest of the modes, all far above the grid, by their power series.

    Attributes:
        omega: (N, m) circular frequencies, rad/s.
        effect: (N, f, m) floor shape times participation factor of each mode.
        residual: (N, f, 3) first terms of the power series of the modes left out, s^2, s^4, s^6.
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


@dataclass(frozen=True)
class ReducedTensors:
    """The arrays of a reduced model as float64 tensors on a device."""

    stiffness_terms: Tensor
    stiffness_constant: Tensor
    excitation: Tensor
    floor_shapes: Tensor

    @classmethod
    def of(cls, model: ReducedModel, device: torch.device | str = "cpu") -> "ReducedTensors":
        """Move a reduced model to a device."""

        def tensor(array: np.ndarray) -> Tensor:
            return torch.as_tensor(array, dtype=torch.float64, device=device)

        return cls(
            tensor(model.stiffness_terms),
            tensor(model.stiffness_constant),
            tensor(model.excitation),
            tensor(model.floor_shapes),
        )

    def stiffness(self, theta: Tensor) -> Tensor:
        """Stiffness matrices (N, r, r), 1/s2, for theta (N, p)."""
        terms = self.stiffness_terms
        size = terms.shape[-1]
        scaled = theta @ terms.reshape(terms.shape[0], size * size)
        return self.stiffness_constant + scaled.reshape(-1, size, size)


def solve_modes(tensors: ReducedTensors, theta: Tensor) -> tuple[Tensor, Tensor]:
    """Return all circular frequencies (N, r), rad/s, and M-orthonormal modes (N, r, r).

    Eigenvalues need float64: squared frequencies of one building span six decades.
    """
    squared, vectors = torch.linalg.eigh(tensors.stiffness(theta.to(torch.float64)))
    return squared.clamp_min(0.0).sqrt(), vectors


def modal_data(
    model: ReducedModel,
    theta: Tensor,
    *,
    modes: int | None = None,
    top_frequency_hz: float | None = None,
    batch: int = 256,
    device: torch.device | str = "cpu",
    progress: Progress = SILENT,
) -> ModalData:
    """Solve the modes of every theta and keep those that the observed floors feel.

    Args:
        model: the reduced model, r coordinates.
        theta: (N, p) stiffness factors.
        modes: how many modes to keep a sample; default all r.
        top_frequency_hz: top of the frequency grid; needed when `modes` leaves some out.
        batch: samples solved at a time.
        device: where to solve.
        progress: advances by one a sample.

    Returns:
        float64 data on the CPU.
    """
    tensors = ReducedTensors.of(model, device)
    parts = []
    for rows in theta.split(batch):
        omega, vectors = solve_modes(tensors, rows.to(device))
        participation = torch.einsum("nrj,r->nj", vectors, tensors.excitation)
        shapes = torch.einsum("fr,nrj->nfj", tensors.floor_shapes, vectors)
        effect = shapes * participation[:, None, :]
        parts.append(keep_modes(omega, effect, modes, top_frequency_hz).to("cpu"))
        progress.advance(len(rows))
    return ModalData(
        torch.cat([p.omega for p in parts]),
        torch.cat([p.effect for p in parts]),
        torch.cat([p.residual for p in parts]),
    )


def keep_modes(
    omega: Tensor, effect: Tensor, modes: int | None, top_frequency_hz: float | None
) -> ModalData:
    """Keep the modes that matter most; the others, taken as stiff, go to the power series.

    Args:
        omega: (N, r) rad/s.
        effect: (N, f, r) floor shape times participation factor.
        modes: how many are kept; all where None.
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
