"""Importance draws about the maxima of a posterior, found by Gauss-Newton from good starts.

Where the noise is far below what a surrogate was trained for, its posterior is too wide to be
refined by weights. Its solutions are starts good enough for a few Gauss-Newton steps on the data's
own residuals; Student distributions with the curvature at the maxima, by their masses, are then a
proposal that fits (Laplace's method; Geweke 1989, Econometrica 57, 1317).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.quasirandom import SobolEngine

from femupdate.dynamics.local_basis import model_about
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.errors import InferenceError
from femupdate.inference.frf_data import FrfData
from femupdate.inference.importance import (
    EDGE,
    LogLikelihood,
    Mixture,
    WeightedDraws,
    importance_sample,
    students,
)
from femupdate.inference.likelihood import Likelihood, Row
from femupdate.inference.parameters import Parameters
from femupdate.maximise import Descent, Residuals, Search, descend, distinct
from femupdate.seeds import Seed, torch_generator

COARSE_NOISE = 0.3
"""In ln|H|, or as a share of a mode's frequency, of searches from afar."""
FEW = 10
"""Parameters up to which points of the prior lead to all maxima."""
# Share of effective draws about maxima below which others take their place. Force at 16
# frequencies: at .44 standard deviations were .91 of the exact ones, by particles .98.
TRUSTED = 0.5


def found_from(prior: Parameters, residuals: Callable[[Tensor], Tensor], starts: Tensor) -> Descent:
    """Different maxima that count, the heaviest first, in standard normal coordinates.

    Args:
        residuals: of parameters, whitened, (n, m): minus half their square is the log likelihood,
            smoothly.
        starts: (s, p) parameters, one at least near every maximum.
    """

    def whitened(xi: Tensor) -> Tensor:
        return residuals(prior.from_normal(xi.clamp(-EDGE, EDGE)))

    # Posteriors of long records are some ten-thousandths wide.
    misfit = Residuals(whitened, 1e-5)
    # A decoder reaches a little beyond the prior's box.
    inside = torch.minimum(torch.maximum(starts, prior.lower), prior.upper)
    ended = descend(
        misfit, prior.to_normal(inside).clamp(-EDGE, EDGE), Search(iterations=25, small_nats=0.02)
    )
    return distinct(ended, ended.log_mass, nats=14.0, count=16)


def wide_start(found: Descent) -> Mixture:
    """Students about maxima, as wide as if a hundredth of the likelihood were known.

    Narrower ones miss tails of a bent posterior: of 20 stories one factor's sd was a quarter less.

    Raises:
        InferenceError: a curvature has no inverse.
    """
    prior = torch.eye(found.z.shape[1], dtype=torch.float64)
    covariance = _covariance(prior + 0.01 * (found.precision - prior))
    return students(found.z.double(), covariance, found.log_mass)


def _covariance(precision: Tensor) -> Tensor:
    """Inverses of matrices (s, d, d); no number where one has none."""
    factor, failed = torch.linalg.cholesky_ex(precision)
    covariance = torch.cholesky_inverse(factor)
    covariance[failed > 0] = torch.nan
    return covariance


def on_fewer_shapes(likelihood: Likelihood, found: Descent, seed: Seed) -> Likelihood:
    """The same on as few shapes as do about its maxima; the whole where effects act on it.

    Responses at some draws make the shapes, and others judge them.
    """
    prior, model = likelihood.prior, likelihood.system.model
    covariance = _covariance(found.precision)
    if model.size < 40 or likelihood.system.placed or not bool(covariance.isfinite().all()):
        return likelihood
    wide = students(found.z.double(), covariance, found.log_mass)
    drawn = wide.sample(48, torch_generator(seed)).clamp(-EDGE, EDGE)
    making, judging = prior.from_normal(drawn).split(24)
    values, top = prior.split(making), likelihood.top_hz
    theta, zeta = values.theta.numpy(), float(values.zeta.min())
    target = ReductionTarget(theta.min(0), theta.max(0), np.linspace(0.0, top, 401)[1:], zeta, 0.0)
    few, known = model_about(model, theta, target), likelihood(judging)
    for size in range(model.size // 4, 2 * model.size // 3, model.size // 12):
        system = replace(likelihood.system, model=few.first(size))
        found_on = replace(likelihood, system=system)
        # Rms of ln of the likelihood, chosen: weights of draws then err by 5 %.
        if float((found_on(judging) - known).square().mean().sqrt()) < 0.05:
            return found_on
    return likelihood


def draws_about(
    prior: Parameters, log_likelihood: LogLikelihood, found: Descent, count: int, seed: Seed
) -> WeightedDraws | None:
    """Weighted parameters (count, p) about maxima, or None where too few of them would count."""
    covariance, centre = _covariance(found.precision), found.z.double()
    # Normal priors are those of sizes, which trade with factors along thin ridges.
    in_logs = bool(prior.centres.numel())
    if in_logs:
        z = centre.clone().requires_grad_()
        logs = prior.to_logs(prior.from_normal(z))
        (slope,) = torch.autograd.grad(logs.sum(), z)
        centre, covariance = logs.detach(), slope[:, :, None] * covariance * slope[:, None]
    try:
        about = students(centre, covariance, found.log_mass)
        drawn = importance_sample(prior, log_likelihood, about, count, seed, in_logs=in_logs)
    except InferenceError:
        return None
    return drawn if drawn.effective >= TRUSTED * count else None


@dataclass(frozen=True, eq=False)
class Settled:
    """Where the likelihood is highest, and what the error of the model may be there.

    Attributes:
        likelihood: summed over the rows of the table that count, the likeliest first.
        found: maxima by the likeliest of them, in standard normal coordinates.
        tried: points of the prior that were judged to find starts.
    """

    likelihood: Likelihood
    found: Descent
    tried: int = 0


def settled(likelihood: Likelihood, seed: Seed, starts: Tensor | None = None) -> Settled:
    """The maxima of a likelihood, and the errors of the model that count there.

    Args:
        likelihood: by all rows of the tables of errors; smooth in the parameters.
        seed: of the points of the prior from which the search starts without `starts`.
        starts: (s, p) parameters, one at least near every maximum.
    """
    # Fits begin as if the model erred much, so that no few points decide.
    prior, tried, row = likelihood.prior, 0, likelihood.error.start
    wide = likelihood.at_row(row)
    if starts is None and prior.size > FEW:
        # Of dozens of factors narrow peaks leave maxima everywhere. Below a peak its flank tells
        # where it must be, and only then the band takes it in (Bunks et al. 1995, Geophysics 60,
        # 1457). Steps of a third lose a tower of twenty stories at its second mode.
        starts = prior.from_normal(torch.zeros(1, prior.size, dtype=torch.float64))
        for share in torch.logspace(-1.0, 0.0, 25).tolist():
            part = likelihood.up_to(share * likelihood.top_hz).about(starts)
            starts = prior.from_normal(found_from(prior, part.residuals, starts).z[:1])
            # On a short way lines tell errors well enough; sought with factors they go astray.
            part = part.holding_likeliest(starts)
            starts = prior.from_normal(found_from(prior, part.residuals, starts).z[:1])
            likelihood = replace(likelihood, known=part.known, system=part.system)
        likelihood = likelihood.about(starts)
        row = _likeliest(_log_posterior(likelihood, starts))
    elif starts is None:
        starts, tried = coarse_maxima(likelihood, seed)
    if likelihood.known is not None and likelihood.changes is None:
        starts = prior.from_normal(found_from(prior, wide.residuals, starts).z)
        likelihood = likelihood.about(starts[:1])
    ended = settle(likelihood, starts, row)
    likelihood, found = _held(ended.likelihood, ended.found)
    return Settled(likelihood, found, tried)


def _held(likelihood: Likelihood, found: Descent) -> tuple[Likelihood, Descent]:
    """With the likeliest known errors in the system, and the maxima with them.

    Factors and errors are sought at once: in turns they go to and fro, for each does what the other
    does. So it is with errors that the system does not hold, whose lines are drawn from halfway.
    """
    prior, size = likelihood.prior, likelihood.prior.size
    if likelihood.known is None:
        return likelihood, found
    errors = likelihood.known.likeliest
    # A step along errors changes members by hundredths of what one along factors does.
    step = torch.cat([torch.full((size,), 1e-5), torch.full((len(errors),), 1e-3)]).to(errors)
    middle = found.z[:1]
    for share in (1.0, *[0.5] * 11):
        misfit = Residuals(likelihood.with_errors(), step)
        both = torch.cat([found.z[:1], errors[None]], dim=1)
        ended = descend(misfit, both, Search(small_nats=0.02, mended=True))
        z, errors = ended.z[:, :size], ended.z[0, size:]
        middle = middle + share * (z - middle)
        likelihood = likelihood.holding(errors, prior.from_normal(middle))
        starts = prior.from_normal(torch.cat([z, found.z[1:]]))
        found = found_from(prior, likelihood.residuals, starts)
        moved = (found.z - middle)[0]
        if float(moved @ found.precision[0] @ moved) < 0.1**2:
            break
    return likelihood, found


def settle(likelihood: Likelihood, starts: Tensor, row: Row) -> Settled:
    """Find the maxima from starts (s, p), by a row at first, and the rows that count there.

    The likeliest error at the end of a fit is taken for the next, and at last none.
    """
    first = likelihood.error.first
    maxima = _fitted(likelihood, starts, row)
    row, points = _best(likelihood, maxima)
    likelihood = replace(likelihood, error=likelihood.error.finer(row))
    if row != first:
        maxima = _fitted(likelihood, points, _likeliest(_log_posterior(likelihood, points)))
    row, points = _best(likelihood, maxima)
    if row not in maxima:
        maxima[row] = found_from(likelihood.prior, likelihood.at_row(row).residuals, points)
    places = [likelihood.prior.from_normal(found.z) for found in maxima.values()]
    apart = zip(*(_log_posterior(likelihood, place) for place in places), strict=True)
    rows = likelihood.error.counting_beside(row, [torch.cat(parts) for parts in apart])
    # Few figures are met by any error: of tables without an axis wide rows weigh as much as narrow
    # ones, which no height tells, and have maxima of their own.
    prior, found = likelihood.prior, [(maxima[row], row, 0)]
    for k, part in enumerate(likelihood.error.parts):
        for other in part.apart_from(row[k]):
            at = (*row[:k], other, *row[k + 1 :])
            found.append((found_from(prior, likelihood.at_row(at).residuals, points), at, k))
    settled_at = likelihood.at_row(row).kept(rows)
    if len(found) == 1:
        return Settled(settled_at, maxima[row])
    heights = [
        _log_posterior(likelihood, prior.from_normal(more.z))[k][:, at[k]] for more, at, k in found
    ]
    parts = zip(*((more.z, more.information, more.pull) for more, _, _ in found), strict=True)
    z, information, pull = (torch.cat(part) for part in parts)
    whole = Descent(z, -torch.cat(heights), information, pull)
    heavy = whole.log_mass > whole.log_mass.max() - 7.0  # a thousandth
    heavy[: len(maxima[row].z)] = True
    return Settled(settled_at, whole[heavy.nonzero()[:, 0].tolist()])


def _fitted(likelihood: Likelihood, starts: Tensor, row: Row) -> dict[Row, Descent]:
    """Maxima from starts (s, p) at a row, then at the likeliest there, and at last at none."""
    maxima: dict[Row, Descent] = {}
    for _ in range(6):
        maxima[row] = found_from(likelihood.prior, likelihood.at_row(row).residuals, starts)
        starts = likelihood.prior.from_normal(maxima[row].z)
        row = _likeliest(_log_posterior(likelihood, starts))
        if row in maxima:
            break
    none = likelihood.error.first
    if none not in maxima:
        maxima[none] = found_from(likelihood.prior, likelihood.at_row(none).residuals, starts)
    return maxima


def _best(likelihood: Likelihood, maxima: dict[Row, Descent]) -> tuple[Row, Tensor]:
    """The likeliest row, and the maxima (s, p) from which that was found."""
    points = [likelihood.prior.from_normal(found.z) for found in maxima.values()]
    judged = [_log_posterior(likelihood, place) for place in points]
    at = max(range(len(points)), key=lambda k: float(judged[k][0].max()))
    return _likeliest(judged[at]), points[at]


def _log_posterior(likelihood: Likelihood, points: Tensor) -> tuple[Tensor, ...]:
    """At points (s, p) by every row of each table, (s, g), and the likeliest of all others."""
    to_normal = likelihood.prior.to_normal(points).clamp(-EDGE, EDGE)
    apart = likelihood.log_densities(points)
    most = [values.max(1).values for values in apart]
    best = torch.stack(most).sum(0) + likelihood.prior.log_density_normal(to_normal)
    return tuple(values + (best - of)[:, None] for values, of in zip(apart, most, strict=True))


def _likeliest(apart: tuple[Tensor, ...]) -> Row:
    """Of the rows of all tables together."""
    at = int(apart[0].max(1).values.argmax())
    return tuple(int(part[at].argmax()) for part in apart)


def coarse_maxima(likelihood: Likelihood, seed: Seed) -> tuple[Tensor, int]:
    """Parameters (s, p) to start from afar, and how many points of the prior were tried.

    FRFs are met by coarse noise first, so that peaks that do not meet show a distance. By the error
    of the model as fits begin, nine of 50 sticks of six stories seen at the roof ended beside the
    highest maximum; from here none does. Modes show their distance.
    """
    prior = likelihood.prior
    if not any(isinstance(kind, FrfData) for kind in likelihood.data):
        return best_of_prior(prior, likelihood.at_row(likelihood.error.start).log_density, seed)
    coarse = likelihood.coarse(COARSE_NOISE)
    likely, tried = best_of_prior(prior, coarse.log_density, seed)
    return prior.from_normal(found_from(prior, coarse.residuals, likely).z), tried


def best_of_prior(
    prior: Parameters, log_likelihood: Callable[[Tensor], Tensor], seed: Seed
) -> tuple[Tensor, int]:
    """Parameters (s, p) that are likely and apart from one another, and how many were tried.

    Args:
        log_likelihood: (n,) of parameters (n, p).
        seed: of the points that are tried.
    """
    # A few starts a parameter, no two of which are likely to end at one maximum.
    count = min(128 * prior.size, 2048)
    scramble = int(torch.randint(2**31, (1,), generator=torch_generator(seed)))
    unit = SobolEngine(prior.size, scramble=True, seed=scramble).draw(count, dtype=torch.float64)
    unit = unit.clamp(1e-6, 1.0 - 1e-6)
    parameters = prior.from_unit(unit)
    value = log_likelihood(parameters).nan_to_num(nan=-torch.inf)
    chosen: list[int] = []
    for row in torch.argsort(value, descending=True).tolist():
        if len(chosen) == 4 * prior.size:
            break
        away = (unit[chosen] - unit[row]).norm(dim=1)
        if bool((away > 0.12 * prior.size**0.5).all()):
            chosen.append(row)
    return parameters[chosen], count
