"""Frequency response functions from modes by their sum, beside those of `System`, for tests."""

import torch
from torch import Tensor

from femupdate.dynamics import DampingLaw, ModalData


def log_frf(modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor) -> Tensor:
    """ln|H| (N, f, k), see `complex_frf`."""
    return complex_frf(modal, frequency_hz, law, zeta).abs().log()


def complex_frf(modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor) -> Tensor:
    """H (N, f, k) at the frequencies (k,), Hz, for the damping zeta (N,), in exp(+i omega t)."""
    omega = (2.0 * torch.pi * frequency_hz).to(modal.omega)
    return torch.complex(*modal.response(omega, law.ratio(modal.omega, zeta.to(modal.omega))))
