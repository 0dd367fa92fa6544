"""Frequency response functions from modes by their sum, beside those of `System`, for tests."""

import torch
from torch import Tensor

from femupdate.dynamics import DampingLaw, ModalData


def log_frf(modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor) -> Tensor:
    """Return ln|H| (N, f, k) at the frequencies (k,), Hz, for the damping zeta (N,).

    Precision and device are those of `modal`; float32 is enough for the response itself (the
    frequencies must have been solved in float64). Memory is N x m x k numbers: see
    `System.log_frf_batches` for many samples.
    """
    real, imaginary = _parts(modal, frequency_hz, law, zeta)
    tiny = torch.finfo(real.dtype).tiny
    return 0.5 * torch.log((real**2 + imaginary**2).clamp_min(tiny))


def complex_frf(modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor) -> Tensor:
    """Return the complex H (N, f, k), with the sign convention exp(+i omega t)."""
    return torch.complex(*_parts(modal, frequency_hz, law, zeta))


def _parts(
    modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor
) -> tuple[Tensor, Tensor]:
    omega = (2.0 * torch.pi * frequency_hz).to(modal.omega)
    return modal.response(omega, law.ratio(modal.omega, zeta.to(modal.omega)))
