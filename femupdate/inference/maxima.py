"""Importance draws about the maxima of a posterior, found by Gauss-Newton from good starts.

Where the noise is far below what a surrogate was trained for, its posterior is too wide to be
refined by weights. Its solutions are starts good enough for a few Gauss-Newton steps on the data's
own residuals; Student distributions with the curvature at the maxima, by their masses, are then a
proposal that fits (Laplace's method; Geweke 1989, Econometrica 57, 1317).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

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
from femupdate.inference.tempering import EDGE, LogLikelihood
from femupdate.seeds import Seed
from femupdate.surrogate.gauss_newton import (
    Descent,
    DescentSettings,
    Kept,
    Residuals,
    descend,
    distinct,
)


@dataclass(frozen=True, kw_only=True)
class MaximaSettings:
    """How maxima are found and drawn about.

    Attributes:
        step: of finite differences in standard normal coordinates, in which posteriors of long
            records are some ten-thousandths wide.
        descent: when the steps end; the last gain is in nats.
        kept: maxima that count.
        lightest: share of the proposal that every maximum has at least: the curvature may
            understate its mass.
        importance: how the proposal is drawn from and fitted again.
        least_share: effective share of the draws below which they are not trusted.
    """

    step: float = 1e-5
    descent: DescentSettings = field(
        default_factory=lambda: DescentSettings(iterations=25, small_gain=0.02)
    )
    kept: Kept = field(default_factory=lambda: Kept(nats=14.0, count=16))
    lightest: float = 0.01
    importance: ImportanceSettings = field(default_factory=ImportanceSettings)
    least_share: float = 0.1


def found_from(
    prior: Parameters,
    residuals: Callable[[Tensor], Tensor],
    starts: Tensor,
    settings: MaximaSettings | None = None,
) -> Descent:
    """Different maxima that count, the heaviest first, in standard normal coordinates.

    Args:
        prior: of the parameters.
        residuals: of parameters, whitened, (n, m): minus half their square is the log likelihood,
            smoothly.
        starts: (s, p) parameters, one at least near every maximum.
        settings: see `MaximaSettings`.
    """
    chosen = settings or MaximaSettings()

    def whitened(xi: Tensor) -> Tensor:
        return residuals(prior.from_normal(xi.clamp(-EDGE, EDGE)))

    misfit = Residuals(whitened, chosen.step)
    # A decoder reaches a little beyond the prior's box.
    inside = torch.minimum(torch.maximum(starts, prior.lower), prior.upper)
    ended = descend(misfit, prior.to_normal(inside).clamp(-EDGE, EDGE), chosen.descent)
    return distinct(ended, ended.log_mass, chosen.kept)


def draws_about(
    prior: Parameters,
    log_likelihood: LogLikelihood,
    found: Descent,
    count: int,
    seed: Seed,
    settings: MaximaSettings | None = None,
) -> WeightedDraws | None:
    """Weighted parameters (count, p) about maxima, or None where too few of them would count.

    Args:
        prior: of the parameters.
        log_likelihood: of them.
        found: the maxima, see `found_from`.
        count: draws.
        seed: of everything random.
        settings: see `MaximaSettings`.
    """
    chosen = settings or MaximaSettings()
    target = normal_target(prior, log_likelihood)
    try:
        drawn = sampled(target, student_about(found, chosen), count, seed, chosen.importance)
    except InferenceError:
        return None
    if drawn.effective < chosen.least_share * count:
        return None
    return replace(drawn, points=prior.from_normal(drawn.points))


def student_about(found: Descent, settings: MaximaSettings) -> StudentMixture:
    """Students about maxima (s, d) with the curvature there, by their masses."""
    weight = found.log_mass.softmax(0).clamp_min(settings.lightest)
    factor, failed = torch.linalg.cholesky_ex(found.precision)
    root, uncertain = torch.linalg.cholesky_ex(torch.cholesky_inverse(factor))
    if bool((failed > 0).any() | (uncertain > 0).any()) or not bool(root.isfinite().all()):
        raise InferenceError("the curvature at a maximum has no inverse; use particles")
    gaussian = GaussianMixture((weight / weight.sum()).log(), found.z.double().cpu(), root)
    return StudentMixture(gaussian.widened(settings.importance.widen), settings.importance.freedom)
