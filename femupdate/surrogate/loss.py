"""The training loss of the MVAE."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.surrogate.network import Mvae
from femupdate.surrogate.visibility import Visibility

# Rows whose noise is generated at a time, so that they stay in the cache.
_ROWS = 64


@dataclass(frozen=True)
class LossSettings:
    """Weights of the terms.

    Attributes:
        noise_sd: standard deviation of the noise on ln|H|.
        noise_octaves: the observation encoder is trained with noise from this many octaves below
            to as many above `noise_sd`.
        points: number of frequencies, drawn anew at every step, for the reconstruction.
        proposal_rows: rows of a batch for the observation encoder. Few are enough: its proposals
            are refined later, and new noise and gaps make every row a new one.
    """

    noise_sd: float = 0.2
    noise_octaves: float = 1.0
    points: int = 128
    proposal_rows: int = 160


@dataclass(frozen=True)
class LossTerms:
    """Mean of each term over the batch, nats per sample.

    Attributes:
        reconstruction: -ln p(x'|z) for z of the parameters, x' a noisy draw.
        proposal: -ln q(z|x) at that z, x another noisy draw that is partly observed.
    """

    reconstruction: Tensor
    proposal: Tensor

    def total(self) -> Tensor:
        """The loss. The proposal shares no weights with the reconstruction."""
        return self.reconstruction + self.proposal


def loss_terms(
    mvae: Mvae,
    log_frf: Tensor,
    theta: Tensor,
    zeta: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
) -> LossTerms:
    """Compute the terms for noise-free ln|H| (B, f, k), theta (B, p) and damping ratios (B,).

    The observation encoder learns which z belongs to an observation, by the forward divergence.
    That covers every solution that an observation admits.
    """
    known = mvae.encode_parameters(theta)
    z = torch.cat([known, mvae.decoder.damping_coordinate(zeta)], dim=1)
    return LossTerms(
        reconstruction(mvae, z, log_frf, settings, generator),
        proposal(mvae, z, log_frf, visibility, settings, generator),
    )


def proposal(
    mvae: Mvae,
    z: Tensor,
    log_frf: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
) -> Tensor:
    """-ln q(z|x) for noisy, partly observed x; mean over the first rows of the batch."""
    count = min(settings.proposal_rows, len(log_frf))
    x = noisy_input(mvae, log_frf[:count], visibility[:count], settings, generator)
    # Products in half precision are good enough for a proposal, and several times faster.
    with torch.autocast("cpu", torch.bfloat16, enabled=has_fast_half()):
        q_x = mvae.observation_encoder(x, visibility[:count])
    return -q_x.log_density(z[:count]).mean()


def reconstruction(
    mvae: Mvae, z: Tensor, log_frf: Tensor, settings: LossSettings, generator: torch.Generator
) -> Tensor:
    """-ln p(x'|z) summed over floors and frequencies, mean over the batch.

    Only `points` frequencies are decoded; the sum is scaled up, an unbiased estimate. The target x'
    carries noise; since the decoder is Gaussian its expectation over that noise is known, and is
    used in place of a draw: (x' - m)^2 becomes (x - m)^2 + noise_sd^2.
    """
    total = log_frf.shape[-1]
    points = min(settings.points, total)
    chosen = torch.randperm(total, generator=generator)[:points]
    target = log_frf[..., chosen].to(z.dtype)
    variance = settings.noise_sd**2 + mvae.decoder.excess_variance(chosen)
    misfit = (target - mvae.decode(z, chosen)) ** 2 + settings.noise_sd**2
    nats = 0.5 * (misfit / variance + torch.log(2.0 * math.pi * variance))
    return nats.sum() * (total / points) / len(log_frf)


def noisy_input(
    mvae: Mvae,
    log_frf: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
) -> Tensor:
    """Input of the observation encoder: standardised, noisy, zero where nothing is observed.

    Args:
        log_frf: (B, f, k).
    """
    count, floors, points = log_frf.shape
    exponent = 2.0 * torch.rand(count, 1, 1, generator=generator) - 1.0
    noise_sd = (settings.noise_sd * 2.0 ** (settings.noise_octaves * exponent)).to(mvae.x_mean)
    x = torch.empty(count, floors, points).to(mvae.x_mean)
    for start in range(0, count, _ROWS):
        rows = slice(start, min(start + _ROWS, count))
        part = x[rows].normal_(generator=generator)
        part.mul_(noise_sd[rows]).add_(log_frf[rows]).sub_(mvae.x_mean).div_(mvae.x_scale)
        part.mul_(visibility[rows].weights(points))
    return x


def has_fast_half() -> bool:
    """Whether this processor has instructions for products of bfloat16 matrices."""
    return torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()
