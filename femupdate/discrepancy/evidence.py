"""Evidence of models with different effects, from the data-space likelihood.

Laplace's approximation about each model's most probable parameters, with the limits of the
parameters taken into account one by one, and on request an importance sample about it (draws of a
multivariate t; Geweke 1989), which says itself how far it can be trusted.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.special import log_ndtr
from torch import Tensor

from femupdate.discrepancy.fit import Fit, densities, raw_residuals
from femupdate.discrepancy.thresholds import EVIDENCE
from femupdate.inference.importance import (
    LogTarget,
    StudentMixture,
    students,
    weighted_draws,
)
from femupdate.inference.joint_error import summed
from femupdate.inference.likelihood import Likelihood
from femupdate.seeds import Seed, torch_generator

_AT_ONCE = 128  # points at a time: a thousand, with all their residuals, take a GB


@dataclass(frozen=True)
class Evidence:
    """Log evidence, up to a constant that all models of the same data share.

    Attributes:
        log_evidence: natural logarithm.
        error: its standard error; zero for Laplace's approximation, which does not know.
        effective: effective number of draws, zero likewise.
    """

    log_evidence: float
    error: float = 0.0
    effective: float = 0.0


def laplace(problem: Likelihood, fitted: Fit) -> Evidence:
    """Laplace's approximation, summed over what the model may err by.

    Args:
        problem: the data.
        fitted: the model at its most probable parameters by its likeliest row.
    """
    log_det = torch.linalg.slogdet(fitted.hessian() + _of_limits(fitted)).logabsdet
    size = fitted.steps.size
    value = float(summed(densities(problem, fitted)))
    value += float(log_prior(fitted, fitted.z[None])[0])
    value += 0.5 * size * np.log(2.0 * np.pi) - 0.5 * float(log_det)
    return Evidence(value + _within_limits(fitted))


def _of_limits(fitted: Fit) -> Tensor:
    """(d, d) curvature for which what the data leave open fills its limits, and no more.

    A damping ratio is left open by modes without any: its own curvature is zero.
    """
    where = fitted.steps
    width = where.upper - where.lower
    uniform = (where.precision.diagonal() == 0.0) & torch.isfinite(width) & (width > 0.0)
    return torch.diag(torch.where(uniform, 2.0 * torch.pi / width.square(), 0.0))


def log_prior(fitted: Fit, z: Tensor) -> Tensor:
    """Log prior density (N,) of the unknowns z (N, d) within their limits."""
    steps = fitted.steps
    # Of theta and zeta themselves, seen in their logarithms.
    uniform = fitted.likelihood.prior.of("stiffness", "damping")
    own = steps.values(z)[:, : len(uniform.entries)]
    value = uniform.log_density(own) + z[:, : steps.first_size].sum(dim=1)
    precision = steps.precision.diagonal()
    normal = precision > 0
    root = precision[normal].sqrt()
    scaled, low, high = (
        (one - steps.mean[normal]) * root
        for one in (z[:, normal], steps.lower[normal], steps.upper[normal])
    )
    mass = torch.special.ndtr(high) - torch.special.ndtr(low)
    density = -0.5 * scaled**2 - 0.5 * np.log(2.0 * np.pi) + root.log() - mass.log()
    return value + density.sum(dim=1)


def _within_limits(fitted: Fit) -> float:
    """Log of the share of the normal approximation that lies within the limits.

    One unknown after the other; where the most probable value sits at its limit, half or less.
    """
    where = fitted.steps
    sd = fitted.covariance().diagonal().clamp_min(1e-30).sqrt()
    low = ((where.lower - fitted.z) / sd).numpy()
    high = ((where.upper - fitted.z) / sd).numpy()
    lower_tail, upper_tail = np.exp(log_ndtr(low)), np.exp(log_ndtr(-high))
    return float(np.log(np.clip(1.0 - lower_tail - upper_tail, 1e-12, 1.0)).sum())


def sampled(problem: Likelihood, fitted: Fit, draws: int = 200, seed: Seed = 0) -> Evidence:
    """Evidence from an importance sample about the most probable parameters."""
    proposal = student_about(fitted, EVIDENCE.widen, EVIDENCE.freedom)
    target = log_target(problem, fitted)
    found = weighted_draws(target, proposal, draws, torch_generator(seed))
    return Evidence(found.log_evidence, found.log_evidence_error, found.effective)


def log_target(problem: Likelihood, fitted: Fit) -> LogTarget:
    """Prior and likelihood of a model's unknowns z (n, d), impossible outside their limits.

    The likelihood is summed over the rows of the table of errors that count at the fit.
    """
    where = fitted.steps
    rows = problem.error.counting([own[None] for own in densities(problem, fitted)])
    error = problem.error.kept(rows)

    def target(z: Tensor) -> tuple[Tensor, Tensor]:
        inside = ((z >= where.lower) & (z <= where.upper)).all(dim=1)
        log_likelihood = torch.full((len(z),), -torch.inf, dtype=torch.float64)
        if inside.any():
            parts = z[inside].split(_AT_ONCE)
            found = [error.log_density(raw_residuals(fitted, some)) for some in parts]
            log_likelihood[inside] = torch.cat(found)
        return log_prior(fitted, z), log_likelihood

    return target


def student_about(fitted: Fit, widen: float, freedom: int) -> StudentMixture:
    """A multivariate t about a model's most probable parameters, with their covariance widened."""
    covariance = fitted.within_limits()[None]
    nothing = covariance.new_zeros(1)
    return students(fitted.z[None], covariance, nothing, widen=widen, freedom=freedom)
