"""Weights of tempered particles: effective size, the next power, resampling."""

import torch
from torch import Tensor


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
