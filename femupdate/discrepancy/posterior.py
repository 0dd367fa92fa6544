"""Draws of a fitted model's posterior, by importance sampling about its most probable parameters.

Proposals are draws of a multivariate t about the most probable parameters with their curvature,
adapted to the weighted draws where these are few; the effective number of draws says how far to
trust them. For a posterior with one mode, which a model fitted to many floors has, this costs a
thousand responses where tempering costs fifty thousand (Geweke 1989).
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.evidence import log_prior
from femupdate.discrepancy.fit import Fit, weighed_residuals
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.proposal import student_draws
from femupdate.seeds import Seed, torch_generator

_FREEDOM = 6.0
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Draws:
    """Equally weighted posterior draws.

    Attributes:
        theta: (n, p) stiffness factors.
        zeta: (n,) damping ratios.
        sizes: (n, q) parameters of the effects.
        log_likelihood: (n,).
        log_evidence: of the model, up to a constant of the data.
        effective: effective number of the proposals behind the draws.
    """

    theta: Floats
    zeta: Floats
    sizes: Floats
    log_likelihood: Floats
    log_evidence: float
    effective: float


def draw(
    problem: Problem, fitted: Fit, count: int, inflation: float = 1.0, seed: Seed = 0
) -> Draws:
    """Draw from the posterior of a fitted model.

    Args:
        problem: structure and data.
        fitted: the model at its most probable parameters.
        count: number of draws, and of proposals a round.
        inflation: variance of the noise over the stated one.
        seed: of everything random.
    """
    generator = torch_generator(seed)
    where = fitted.coordinates
    centre, covariance = fitted.weighed.z, 1.3 * fitted.covariance(inflation)
    for _ in range(_ROUNDS):
        z, log_proposal = student_draws(centre, covariance, _FREEDOM, count, generator)
        inside = ((z >= where.lower) & (z <= where.upper)).all(dim=1)
        log_likelihood = torch.full((count,), -torch.inf, dtype=torch.float64)
        residual = weighed_residuals(problem, fitted, z[inside])
        log_likelihood[inside] = -0.5 * (residual**2).sum(dim=1) / inflation
        log_weight = log_likelihood - log_proposal
        log_weight[inside] += log_prior(problem, fitted, z[inside])
        weight = torch.softmax(log_weight, dim=0)
        effective = float(1.0 / (weight**2).sum())
        if effective > 0.3 * count:
            break
        centre = (weight[:, None] * z).sum(dim=0)
        spread = z - centre
        covariance = 1.3 * (spread.T * weight) @ spread + 0.05 * covariance
    chosen = _systematic(weight, count, generator)
    theta, zeta, sizes = where.split(
        _errant(problem, fitted, z[chosen], generator), problem.fixed_zeta
    )
    evidence = float(torch.logsumexp(log_weight, dim=0)) - np.log(count)
    return Draws(
        theta.numpy(),
        zeta.numpy(),
        sizes.numpy(),
        log_likelihood[chosen].numpy(),
        evidence,
        effective,
    )


def _errant(problem: Problem, fitted: Fit, z: Tensor, generator: torch.Generator) -> Tensor:
    """Draws (n, d) with sizes off by as much as the model of an effect may err, within limits."""
    where, moved = fitted.coordinates, z.clone()
    sizes = moved[:, where.first_size :]
    sizes *= 1.0 + problem.own_error * torch.randn(
        sizes.shape, generator=generator, dtype=torch.float64
    )
    return torch.minimum(torch.maximum(moved, where.lower), where.upper)


def _systematic(weight: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Indices (n,) of systematic resampling (Kitagawa 1996)."""
    start = torch.rand(1, generator=generator, dtype=torch.float64)
    points = (torch.arange(count, dtype=torch.float64) + start) / count
    return torch.searchsorted(weight.cumsum(0).clamp_max(1.0), points).clamp_max(count - 1)
