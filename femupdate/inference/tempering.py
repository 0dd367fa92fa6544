"""What samplers share: weights, steps of tempering, resampling, and what a run gives."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

EDGE = 8.0  # standard normal coordinate from which a parameter is at its bound

LogLikelihood = Callable[[Tensor], Tensor]
"""Log likelihood (n,) of parameters (n, p)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SamplerRun:
    """Equally weighted draws of prior times likelihood.

    Attributes:
        theta: (n, p) parameters.
        log_likelihood: (n,).
        log_evidence: log of the mean likelihood under the prior.
        evaluations: of the likelihood, all in all.
        log_evidence_error: its standard error by weights; NaN where the draws had none.
        effective: effective sample size of weighted draws that these were chosen from; zero
            likewise.
        effective_share: of those; zero likewise.
        levels: of tempering.
        invalid: evaluations that gave no finite number; all count as impossible.
        acceptance: mean share of moves accepted while draws were kept; NaN where none were.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: float
    evaluations: int
    log_evidence_error: float = math.nan
    effective: float = 0.0
    effective_share: float = 0.0
    levels: int = 0
    invalid: int = 0
    acceptance: float = math.nan


def effective_sample_size(log_weight: Tensor) -> float:
    """(sum w)^2 / sum w^2 of log weights (n,) (Kish 1965), between 1 and n."""
    return float(
        torch.exp(2.0 * torch.logsumexp(log_weight, 0) - torch.logsumexp(2.0 * log_weight, 0))
    )


def next_increment(gain: Tensor, most: float, ess_target: float) -> float:
    """Largest step of beta, up to `most`, that keeps the share `ess_target` of the particles.

    Found by bisection, to a thousandth. At least 1e-12, so that the sampler goes on where fewer
    particles than that are possible at all.

    Args:
        gain: (n,) log likelihood gained per unit of beta, minus infinity where impossible.
        most: what is left up to beta = 1.
        ess_target: share of the particles, 0 to 1.
    """
    wanted = ess_target * len(gain)
    if effective_sample_size(most * gain) >= wanted:
        return most
    low, high = 0.0, most
    while high - low > 1e-3 * high and high > 1e-12:
        middle = 0.5 * (low + high)
        if effective_sample_size(middle * gain) < wanted:
            high = middle
        else:
            low = middle
    return max(low, 1e-12)


def systematic_rows(weight: Tensor, generator: torch.Generator, count: int | None = None) -> Tensor:
    """Systematic resampling (Kitagawa 1996): row indices for weights (n,) that sum to one.

    As many as there are weights, or `count`. Row i comes floor(count w_i) or ceil(count w_i) times,
    count w_i times on average; weight zero never comes.
    """
    count = count or len(weight)
    uniform = torch.rand(1, generator=generator, dtype=weight.dtype, device=weight.device)
    # Points in (0, 1] and edges that end at exactly 1: rounding cannot reach a row of weight zero.
    points = (
        torch.arange(1, count + 1, dtype=weight.dtype, device=weight.device) - uniform
    ) / count
    edges = weight.cumsum(0)
    return torch.searchsorted(edges / edges[-1], points)
