"""FRFs as an estimate from histories shows them: averaged by the window of its segments."""

import numpy as np
import torch
from torch import Tensor

from femupdate.measurement.observation import Observation

HANN = 1.5  # equivalent noise bandwidth of the Hann window times its length
_REACH = 3.0  # in units of 1 / T; beyond it the spectrum of the Hann window is negligible


def segment_of(observation: Observation) -> float | None:
    """Length of the Hann segments from which H1 estimated FRFs, s; None for a table."""
    if observation.coherence is None:
        return None
    frequency = observation.frequency_hz
    return HANN / (observation.resolution_hz or float(np.median(np.diff(frequency))))


def as_estimated(frf: Tensor, segment_s: float | None, frequency_hz: Tensor) -> Tensor:
    """FRFs (N, f, k) as Welch's method shows them: averaged over the spectrum of its window.

    Of white noise H1 shows H averaged with the weight |W|^2, W = sinc(x) / (1 - x^2) with
    x = f T for a Hann window of T seconds (Bendat and Piersol 2010, section 8.5; Harris 1978).
    Without this, the finder would take the lower peaks for an effect.
    """
    if segment_s is None or frf.shape[2] < 2:
        return frf
    step = segment_s * float(frequency_hz[1] - frequency_hz[0])
    reach = min(int(np.ceil(_REACH / step)), frf.shape[2] - 1)
    x = step * np.arange(-reach, reach + 1)
    x = np.where(np.abs(np.abs(x) - 1.0) < 1e-6, 1.0 - 1e-6, x)
    weight = torch.from_numpy((np.sinc(x) / (1.0 - x**2)) ** 2)
    weight = (weight / weight.sum()).reshape(1, 1, -1)
    ends = [frf[..., :1].expand(-1, -1, reach), frf[..., -1:].expand(-1, -1, reach)]
    wide = torch.cat([ends[0], frf, ends[1]], dim=2).reshape(-1, 1, frf.shape[2] + 2 * reach)
    parts = [torch.nn.functional.conv1d(part, weight) for part in (wide.real, wide.imag)]
    return torch.complex(*parts).reshape(frf.shape)
