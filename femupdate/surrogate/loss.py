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
class Share:
    """Rows of a batch that one of several processes takes: every `count`-th, from its own number.

    Attributes:
        number: of the process, from 0.
        count: of processes, at most one a row.
    """

    number: int = 0
    count: int = 1

    def rows(self, start: int = 0, stop: int | None = None) -> slice:
        """Its rows from `start` to before `stop`, as rows of the whole batch."""
        return slice(start + (self.number - start) % self.count, stop, self.count)


WHOLE = Share()


@dataclass(frozen=True)
class LossTerms:
    """Mean of each term over the batch, nats per sample; of a share, its part of that mean.

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
    share: Share = WHOLE,
) -> LossTerms:
    """Compute the terms for noise-free ln|H| (B, f, k), theta (B, p) and damping ratios (B,).

    The observation encoder learns which z belongs to an observation, by the forward divergence.
    That covers every solution that an observation admits.

    The terms of all shares add up to those of the batch. Random numbers are drawn for the whole
    batch, so that all processes draw the same.
    """
    own = share.rows()
    known = mvae.encode_parameters(theta[own])
    z = torch.cat([known, mvae.decoder.damping_coordinate(zeta[own])], dim=1)
    weight = len(z) / len(theta)
    return LossTerms(
        weight * reconstruction(mvae, z, log_frf[own], settings, generator),
        proposal(mvae, z, log_frf, visibility, settings, generator, share),
    )


def proposal(
    mvae: Mvae,
    z: Tensor,
    log_frf: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
    share: Share = WHOLE,
) -> Tensor:
    """-ln q(z|x) for noisy, partly observed x; mean over the first rows of the batch.

    Args:
        z: of the share's rows; `log_frf` and `visibility` are of the whole batch.
    """
    count = min(settings.proposal_rows, len(log_frf))
    x = noisy_input(mvae, log_frf[:count], visibility[:count], settings, generator, share)
    # Products in half precision are good enough for a proposal, and several times faster.
    with torch.autocast("cpu", torch.bfloat16, enabled=has_fast_half()):
        q_x = mvae.observation_encoder(x, visibility[share.rows(stop=count)])
    # Not a mean: a share may have none of these rows.
    return -q_x.log_density(z[: len(x)]).sum() / count


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
    share: Share = WHOLE,
) -> Tensor:
    """Input of the observation encoder: standardised, noisy, zero where nothing is observed.

    Args:
        log_frf: (B, f, k).

    Returns:
        (b, f, k) of the share's rows.
    """
    count, floors, points = log_frf.shape
    exponent = 2.0 * torch.rand(count, 1, 1, generator=generator) - 1.0
    noise_sd = (settings.noise_sd * 2.0 ** (settings.noise_octaves * exponent)).to(mvae.x_mean)
    drawn = torch.empty(min(_ROWS, count), floors, points, dtype=mvae.x_mean.dtype)
    own = share.rows(stop=count)
    x = torch.empty(len(range(count)[own]), floors, points).to(mvae.x_mean)
    for start in range(0, count, _ROWS):
        end = min(start + _ROWS, count)
        noise = drawn[: end - start].normal_(generator=generator)
        rows = share.rows(start, end)
        part = x[len(range(start)[own]) :][: len(range(end)[rows])]
        part.copy_(noise[rows.start - start :: share.count])
        part.mul_(noise_sd[rows]).add_(log_frf[rows]).sub_(mvae.x_mean).div_(mvae.x_scale)
        part.mul_(visibility[rows].weights(points))
    return x


def has_fast_half() -> bool:
    """Whether this processor has instructions for products of bfloat16 matrices."""
    return torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()
