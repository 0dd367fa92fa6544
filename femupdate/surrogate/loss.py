"""What the MVAE is trained for."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.surrogate.latent import latent_log_likelihood
from femupdate.surrogate.network import LatentGaussian, Mvae, Visibility


@dataclass(frozen=True)
class LossSettings:
    """Weights of the terms.

    Attributes:
        noise_sd: standard deviation of the noise on ln|H|.
        coupling: alpha, weight of the divergences between the two encoders, both ways.
        reconstruction: weight w of the reconstruction and the cross-modal prediction. With two
            independent noisy draws the variance of a linear-Gaussian latent posterior is right
            when w = 2 + 4 alpha: the stationary point of w v / s^2 - ln v + alpha s^2 / v is
            v = s^2 / 2, half the exact variance s^2 for each of the two encoders.
        contrast: weight of the local contrast, see `local_contrast`.
        contrast_rows: rows of a batch that it is computed for.
        alternatives: alternative parameter vectors a row.
        points: frequencies, drawn afresh every step, on which reconstructions are compared.
    """

    noise_sd: float = 0.2
    coupling: float = 5.0
    reconstruction: float = 22.0
    contrast: float = 3.0
    contrast_rows: int = 192
    alternatives: int = 8
    points: int = 256


@dataclass(frozen=True)
class LossTerms:
    """Mean over the batch of each term, nats a sample.

    Attributes:
        reconstruction: -ln p(x'|z) of both encoders' z, x' an independent noisy draw.
        prior_divergence: KL of both encoders from the prior of z.
        coupling: KL between the encoders, both ways.
        contrast: cross-entropy of finding the true theta among alternatives near it.
    """

    reconstruction: Tensor
    prior_divergence: Tensor
    coupling: Tensor
    contrast: Tensor

    def total(self, settings: LossSettings) -> Tensor:
        """The loss, divided by the reconstruction weight so that its scale stays the same."""
        elbo = (
            settings.reconstruction * self.reconstruction
            + self.prior_divergence
            + settings.coupling * self.coupling
        )
        return elbo / settings.reconstruction + settings.contrast * self.contrast


def loss_terms(
    mvae: Mvae,
    log_frf: Tensor,
    theta: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
) -> LossTerms:
    """Compute the terms for noise-free ln|H| (B, f, k) and theta (B, p).

    The encoder sees the FRF with fresh noise. The reconstruction target carries an independent
    noise; since the decoder is Gaussian its expectation over that noise is known, and is used in
    place of a draw: (x' - m)^2 becomes (x - m)^2 + noise_sd^2.
    """
    noise = torch.empty_like(log_frf).normal_(generator=generator)
    q_x = mvae.encode_observation(log_frf + settings.noise_sd * noise, visibility)
    q_theta = mvae.encode_parameters(theta, visibility)
    return LossTerms(
        _reconstruction(mvae, (q_x, q_theta), log_frf, visibility, settings, generator),
        (prior_divergence(q_x) + prior_divergence(q_theta)).mean(),
        (divergence(q_x, q_theta) + divergence(q_theta, q_x)).mean(),
        local_contrast(mvae, q_x, q_theta, theta, visibility, settings, generator)
        if settings.contrast > 0.0
        else log_frf.new_zeros(()),
    )


def _reconstruction(
    mvae: Mvae,
    posteriors: tuple[LatentGaussian, LatentGaussian],
    log_frf: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
) -> Tensor:
    """-ln p(x'|z) summed over what is observed, and over both encoders.

    Only `points` frequencies are decoded; the sum is scaled up, an unbiased estimate.
    """
    total = log_frf.shape[-1]
    points = min(settings.points, total)
    chosen = torch.randperm(total, generator=generator)[:points]
    scale = mvae.x_scale[:, chosen]
    target = (log_frf[..., chosen] - mvae.x_mean[:, chosen]) / scale
    draws = [q.sample(_normal_like(q.mean, generator)) for q in posteriors]
    mean, log_excess = mvae.decoder(torch.cat(draws), chosen)
    variance = settings.noise_sd**2 + scale**2 * log_excess.exp()
    misfit = ((torch.cat([target, target]) - mean) * scale) ** 2 + settings.noise_sd**2
    nats = 0.5 * (misfit / variance + torch.log(2.0 * math.pi * variance))
    observed = visibility.weights(total, chosen)
    return (nats * torch.cat([observed, observed])).sum() * (total / points) / len(log_frf)


def local_contrast(
    mvae: Mvae,
    q_x: LatentGaussian,
    q_theta: LatentGaussian,
    theta: Tensor,
    visibility: Visibility,
    settings: LossSettings,
    generator: torch.Generator,
) -> Tensor:
    """Cross-entropy of picking the true theta among alternatives around it, nats.

    A hidden centre is drawn around the true theta and the alternatives around that centre with the
    same spread: under the flat prior all are exchangeable, so the true posterior, and only its
    shape, minimises the cross-entropy (a proper score; the idea of contrastive likelihood-ratio
    estimation, Hermans et al. 2020, made local). Spreads run from far below the posterior's width
    to a third of the box, so the width of the latent posterior is scored at its own scale. It
    needs no simulation: only the parameter encoder is evaluated at the alternatives.
    """
    rows = slice(0, min(settings.contrast_rows, len(theta)))
    box = mvae.upper - mvae.lower
    unit = (theta[rows] - mvae.lower) / box
    count, size = unit.shape
    others = settings.alternatives
    exponent = torch.rand(count, 1, generator=generator)
    spread = 0.0015 * 200.0**exponent
    centre = unit + spread * _normal_like(unit, generator)
    offsets = torch.randn(count, others, size, generator=generator)
    near = centre[:, None] + spread[:, None] * offsets
    inside = ((near > 0.0) & (near < 1.0)).all(-1)
    candidates = mvae.lower + box * near.clamp(0.0, 1.0)
    q_near = mvae.encode_parameters(
        candidates.reshape(count * others, size), visibility[rows].repeat(others)
    )
    shape = (count, others, -1)
    other = latent_log_likelihood(
        q_x.mean[rows, None],
        q_x.variance[rows, None],
        q_near.mean.reshape(shape),
        q_near.variance.reshape(shape),
    ).masked_fill(~inside, -1e9)
    own = latent_log_likelihood(
        q_x.mean[rows], q_x.variance[rows], q_theta.mean[rows], q_theta.variance[rows]
    )
    return (torch.logsumexp(torch.cat([own[:, None], other], dim=1), dim=1) - own).mean()


def prior_divergence(q: LatentGaussian) -> Tensor:
    """KL(q || standard normal), (B,)."""
    return 0.5 * (q.mean**2 + q.variance - q.variance.log() - 1.0).sum(-1)


def divergence(q: LatentGaussian, p: LatentGaussian) -> Tensor:
    """KL(q || p) of diagonal Gaussians, (B,)."""
    ratio = q.variance / p.variance
    return 0.5 * (ratio - ratio.log() - 1.0 + (q.mean - p.mean) ** 2 / p.variance).sum(-1)


def _normal_like(tensor: Tensor, generator: torch.Generator) -> Tensor:
    return torch.empty_like(tensor).normal_(generator=generator)
