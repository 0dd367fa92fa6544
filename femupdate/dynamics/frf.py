"""Log frequency response functions: absolute floor acceleration over base acceleration."""

from collections.abc import Iterator

import torch
from torch import Tensor

from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.modal import ModalData

# Size of one intermediate array (samples x modes x frequencies).
_CPU_BYTES = 2**20
_GPU_BYTES = 512 * 2**20


def log_frf(modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor) -> Tensor:
    """Return ln|H| (N, f, k) at the frequencies (k,), Hz, for the damping zeta (N,).

    Precision and device are those of `modal`; float32 is enough for the response itself (the
    frequencies must have been solved in float64). Memory is N x m x k numbers: see
    `log_frf_batches` for many samples.
    """
    real, imaginary = frf_parts(modal, frequency_hz, law, zeta)
    tiny = torch.finfo(real.dtype).tiny
    return 0.5 * torch.log((real**2 + imaginary**2).clamp_min(tiny))


def complex_frf(modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor) -> Tensor:
    """Return the complex H (N, f, k), with the sign convention exp(+i omega t)."""
    return torch.complex(*frf_parts(modal, frequency_hz, law, zeta))


def frf_parts(
    modal: ModalData, frequency_hz: Tensor, law: DampingLaw, zeta: Tensor
) -> tuple[Tensor, Tensor]:
    """Real and imaginary part of H, each (N, f, k); two real sums are faster than a complex one."""
    w = (2.0 * torch.pi * frequency_hz).to(modal.omega)
    omega = modal.omega[:, :, None]
    ratio = law.ratio(modal.omega, zeta.to(modal.omega))[:, :, None]
    stiffness = omega**2 - w**2
    damping = 2.0 * ratio * omega * w
    gain = w**2 / (stiffness**2 + damping**2)
    powers = torch.stack([w ** (2 * k + 2) for k in range(modal.residual.shape[-1])])
    series = modal.residual @ powers
    real = 1.0 + torch.bmm(modal.effect, stiffness * gain) + series
    imaginary = -torch.bmm(modal.effect, damping * gain)
    return real, imaginary


def log_frf_batches(
    modal: ModalData,
    frequency_hz: Tensor,
    law: DampingLaw,
    zeta: Tensor,
    *,
    batch: int | None = None,
) -> Iterator[Tensor]:
    """Yield ln|H| of consecutive samples, `batch` of them at a time; default what is fastest."""
    batch = batch or fast_batch(modal, len(frequency_hz))
    for start in range(0, len(modal), batch):
        rows = slice(start, start + batch)
        yield log_frf(modal[rows], frequency_hz, law, zeta[rows])


def fast_batch(modal: ModalData, points: int) -> int:
    """Samples at a time whose intermediate arrays stay in the processor's cache.

    Larger batches are up to seven times slower on a CPU; a GPU wants larger ones.
    """
    room = _CPU_BYTES if modal.omega.device.type == "cpu" else _GPU_BYTES
    return max(1, room // (modal.omega.shape[1] * points * modal.omega.element_size()))
