"""Draws of a fitted model's posterior, by importance sampling about its most probable parameters.

For a posterior with one mode, which a model fitted to many floors has, this costs a thousand
responses where tempering costs fifty thousand; the effective number of draws says how far to trust
them.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.evidence import log_target, student_about
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.thresholds import EVIDENCE
from femupdate.inference.importance import ImportanceSettings, sampled
from femupdate.seeds import Seed, spawn, torch_generator

_SETTINGS = ImportanceSettings(
    components=1,
    rounds=EVIDENCE.rounds,
    enough=EVIDENCE.enough,
    widen=EVIDENCE.posterior_widen,
    freedom=EVIDENCE.posterior_freedom,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Draws:
    """Equally weighted posterior draws.

    Attributes:
        theta: (n, p) stiffness factors.
        zeta: (n,) damping ratios.
        sizes: (n, q) parameters of the effects.
        log_likelihood: (n,).
        log_evidence: of the model, up to a constant of the data.
        log_evidence_error: its standard error.
        effective: effective number of the weighted draws behind these.
        evaluations: likelihoods that it took.
    """

    theta: Floats
    zeta: Floats
    sizes: Floats
    log_likelihood: Floats
    log_evidence: float
    log_evidence_error: float
    effective: float
    evaluations: int


def draw(problem: Problem, fitted: Fit, count: int, seed: Seed = 0) -> Draws:
    """Draw from the posterior of a fitted model.

    Args:
        problem: structure and data.
        fitted: the model at its most probable parameters.
        count: number of draws, and of weighted ones behind them.
        seed: of everything random.

    Raises:
        InferenceError: no draw about the fit is possible.
    """
    weighing, choosing, erring = spawn(seed, 3)
    proposal = student_about(fitted, _SETTINGS.widen, _SETTINGS.freedom)
    target = log_target(problem, fitted)
    found = sampled(target, proposal, count, weighing, _SETTINGS)
    z, log_likelihood = found.resample(count, choosing)
    theta, zeta, sizes = fitted.coordinates.split(
        _errant(problem, fitted, z, torch_generator(erring)), problem.fixed_zeta
    )
    return Draws(
        theta=theta.numpy(),
        zeta=zeta.numpy(),
        sizes=sizes.numpy(),
        log_likelihood=log_likelihood.numpy(),
        log_evidence=found.log_evidence,
        log_evidence_error=found.log_evidence_error,
        effective=found.effective,
        evaluations=found.evaluations,
    )


def _errant(problem: Problem, fitted: Fit, z: Tensor, generator: torch.Generator) -> Tensor:
    """Draws (n, d) with sizes off by as much as the model of an effect may err, within limits."""
    where, moved = fitted.coordinates, z.clone()
    sizes = moved[:, where.first_size :]
    sizes *= 1.0 + problem.own_errors(fitted.placed) * torch.randn(
        sizes.shape, generator=generator, dtype=torch.float64
    )
    return torch.minimum(torch.maximum(moved, where.lower), where.upper)
