"""Effects that stiffness factors and damping make up for, so that no data of these sensors show.

The score test projects along straight lines, which a large step of an effect leaves even where the
factors could follow it exactly (a soft base under a shear building is a soft first story). Here the
model without the effect is fitted to what the model with it predicts.
"""

from functools import partial

import numpy as np
import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, extended, raw_residuals
from femupdate.discrepancy.score import Score, alike
from femupdate.discrepancy.thresholds import FOLLOW
from femupdate.inference.likelihood import Likelihood
from femupdate.workers import in_threads


def unobservable_effects(
    problem: Likelihood, base: Fit, scores: list[Score], least: float
) -> tuple[str, ...]:
    """Labels of the effects whose strength is below `least` once the model has followed them.

    Args:
        problem: the likelihood of the data.
        base: the model without them, fitted.
        scores: their score tests.
        least: strength, the D per prior standard deviation of their size.
    """
    doubtful = [
        one
        for one in scores
        if one.strength >= least and one.start and one.absorbed > FOLLOW.absorbed
    ]
    left = _left(problem, base, doubtful)
    faint = {
        one.placed.label
        for one, share in zip(doubtful, left, strict=True)
        if share * one.strength / (1.0 - one.absorbed) ** 0.5 < least
    }
    return tuple(s.placed.label for s in scores if s.strength < least or s.placed.label in faint)


def same_to_sensors(problem: Likelihood, base: Fit, tests: list[Score], cosine: float) -> bool:
    """Whether several effects leave the same once the model has followed each of them.

    Args:
        problem: the likelihood of the data.
        base: the model without them, fitted.
        tests: their score tests, the first to be compared with all others.
        cosine: between what they leave, from which they count as the same.
    """
    if not all(one.start for one in tests):
        return all(alike(tests[0], one) >= cosine for one in tests[1:])
    left = _follow(problem, base, tests)[1]
    unit = left / left.norm(dim=1, keepdim=True).clamp_min(1e-12)
    return bool(((unit[1:] @ unit[0]).abs() >= cosine).all())


def _left(problem: Likelihood, base: Fit, tests: list[Score]) -> list[float]:
    """Share of what each effect changes that the refitted model does not follow."""
    if not tests:
        return []
    target, remains = _follow(problem, base, tests)
    return [float(one) for one in remains.norm(dim=1) / target.norm(dim=1).clamp_min(1e-12)]


def _follow(problem: Likelihood, base: Fit, tests: list[Score]) -> tuple[Tensor, Tensor]:
    """What each effect changes, and what of it the refitted model does not follow, (t, n)."""
    target = torch.stack(in_threads(partial(_change, problem, base), tests))  # (t, n)
    where = base.steps
    normal = base.jacobian.T @ base.jacobian
    ridge = 1e-9 * torch.diag(normal.diagonal().clamp_min(1e-12))
    inverse = torch.linalg.pinv(normal + ridge, hermitian=True)
    z = base.z.expand(len(tests), -1).clone()
    remains = target.clone()
    for _ in range(FOLLOW.rounds):
        step = remains @ base.jacobian @ inverse
        trial = torch.minimum(torch.maximum(z + step.clamp(-1.0, 1.0), where.lower), where.upper)
        followed = base.residual - base.likelihood.whitened(raw_residuals(base, trial))
        better = (target - followed).norm(dim=1) < remains.norm(dim=1)
        if not better.any():
            break
        z = torch.where(better[:, None], trial, z)
        remains = torch.where(better[:, None], target - followed, remains)
    return target, remains


def _change(problem: Likelihood, base: Fit, one: Score) -> Tensor:
    """(n,) change of the whitened prediction by an effect."""
    together = (*base.placed, one.placed)
    neutral = one.placed.effect.parameters[0].neutral
    size = neutral + FOLLOW.step * (one.start[0] - neutral)
    z = extended(problem, base, together, np.array([*base.known, size, *one.start[1:]]))
    own = problem.with_effects(together)
    return base.residual - own.residuals(own.prior.steps.values(z[None]))[0]
