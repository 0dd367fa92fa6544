"""Draws of a multivariate t, from which importance samples are taken."""

import numpy as np
import torch
from torch import Tensor

_SLIGHT = 1e-12  # of the mean variance, so that rounding cannot make a covariance indefinite


def student_draws(
    centre: Tensor, covariance: Tensor, freedom: float, count: int, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Draws (n, d) of a multivariate t and their log density (n,).

    Args:
        centre: (d,).
        covariance: (d, d) scale matrix.
        freedom: degrees of freedom.
        count: number of draws n.
        generator: of everything random.
    """
    size = len(centre)
    ridge = _SLIGHT * covariance.diagonal().mean() * torch.eye(size, dtype=torch.float64)
    root = torch.linalg.cholesky(0.5 * (covariance + covariance.T) + ridge)
    normal = torch.randn(count, size, generator=generator, dtype=torch.float64)
    seed = int(torch.randint(2**31, (1,), generator=generator))
    chi = np.random.default_rng(seed).chisquare(freedom, count) / freedom
    shift = normal / torch.from_numpy(chi).sqrt()[:, None]
    half = torch.tensor(0.5 * freedom, dtype=torch.float64)
    constant = (
        torch.lgamma(half + 0.5 * size)
        - torch.lgamma(half)
        - 0.5 * size * np.log(freedom * np.pi)
        - root.diagonal().log().sum()
    )
    tails = torch.log1p((shift**2).sum(dim=1) / freedom)
    return centre + shift @ root.T, constant - 0.5 * (freedom + size) * tails
