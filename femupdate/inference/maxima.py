"""Importance draws about the maxima of a posterior, found by Gauss-Newton from good starts.

Where the noise is far below what a surrogate was trained for, its posterior is too wide to be
refined by weights. Its solutions are starts good enough for a few Gauss-Newton steps on the data's
own residuals; Student distributions with the curvature at the maxima, by their masses, are then a
proposal that fits (Laplace's method; Geweke 1989, Econometrica 57, 1317).
"""

from collections.abc import Callable
from dataclasses import replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.importance import (
    ImportanceSettings,
    WeightedDraws,
    normal_target,
    sampled,
)
from femupdate.inference.mixture import GaussianMixture, StudentMixture
from femupdate.inference.parameters import Parameters
from femupdate.inference.tempering import LogLikelihood
from femupdate.inference.thresholds import DRAWS, MAXIMA
from femupdate.seeds import Seed
from femupdate.surrogate.gauss_newton import (
    Descent,
    DescentSettings,
    Kept,
    Residuals,
    descend,
    distinct,
)


def found_from(
    prior: Parameters,
    residuals: Callable[[Tensor], Tensor],
    starts: Tensor,
) -> Descent:
    """Different maxima that count, the heaviest first, in standard normal coordinates.

    Args:
        prior: of the parameters.
        residuals: of parameters, whitened, (n, m): minus half their square is the log likelihood,
            smoothly.
        starts: (s, p) parameters, one at least near every maximum.
    """

    def whitened(xi: Tensor) -> Tensor:
        return residuals(prior.from_normal(xi.clamp(-DRAWS.edge, DRAWS.edge)))

    misfit = Residuals(whitened, MAXIMA.step)
    # A decoder reaches a little beyond the prior's box.
    inside = torch.minimum(torch.maximum(starts, prior.lower), prior.upper)
    ended = descend(
        misfit,
        prior.to_normal(inside).clamp(-DRAWS.edge, DRAWS.edge),
        DescentSettings(MAXIMA.steps, MAXIMA.small_gain),
    )
    return distinct(ended, ended.log_mass, Kept(MAXIMA.nats, MAXIMA.most))


def draws_about(
    prior: Parameters,
    log_likelihood: LogLikelihood,
    found: Descent,
    count: int,
    seed: Seed,
    least: float = MAXIMA.trusted,
) -> WeightedDraws | None:
    """Weighted parameters (count, p) about maxima, or None where too few of them would count.

    Args:
        prior: of the parameters.
        log_likelihood: of them.
        found: the maxima, see `found_from`.
        count: draws.
        seed: of everything random.
        least: share of the draws that must be effective.
    """
    settings = ImportanceSettings()
    target = normal_target(prior, log_likelihood)
    try:
        drawn = sampled(target, student_about(found, settings), count, seed, settings)
    except InferenceError:
        return None
    if drawn.effective < least * count:
        return None
    return replace(drawn, points=prior.from_normal(drawn.points))


def student_about(found: Descent, settings: ImportanceSettings) -> StudentMixture:
    """Students about maxima (s, d) with the curvature there, by their masses."""
    weight = found.log_mass.softmax(0).clamp_min(MAXIMA.lightest)
    factor, failed = torch.linalg.cholesky_ex(found.precision)
    root, uncertain = torch.linalg.cholesky_ex(torch.cholesky_inverse(factor))
    if bool((failed > 0).any() | (uncertain > 0).any()) or not bool(root.isfinite().all()):
        raise InferenceError("the curvature at a maximum has no inverse; use particles")
    gaussian = GaussianMixture((weight / weight.sum()).log(), found.z.double().cpu(), root)
    return StudentMixture(gaussian.widened(settings.widen), settings.freedom)
