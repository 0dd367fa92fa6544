"""Importance draws about the maxima of a posterior, found by Gauss-Newton from good starts.

Where the noise is far below what a surrogate was trained for, its posterior is too wide to be
refined by weights. Its solutions are starts good enough for a few Gauss-Newton steps on the data's
own residuals; Student distributions with the curvature at the maxima, by their masses, are then a
proposal that fits (Laplace's method; Geweke 1989, Econometrica 57, 1317).
"""

from collections.abc import Callable

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.importance import WeightedDraws, importance_sample, students
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
    factor, failed = torch.linalg.cholesky_ex(found.precision)
    covariance = torch.cholesky_inverse(factor)
    covariance[failed > 0] = torch.nan
    try:
        proposal = students(found.z.double().cpu(), covariance, found.log_mass)
        drawn = importance_sample(prior, log_likelihood, proposal, count, seed)
    except InferenceError:
        return None
    return drawn if drawn.effective >= least * count else None
