"""Most probable parameters of a model with effects, by Levenberg and Marquardt's method.

What the model errs by is learned with them: a fit takes one row of the table of
`inference.model_error` for true, and the row that its residuals make likeliest is taken next.

The unknowns are ln theta and ln zeta (uniform priors on a box) and the sizes of the effects in
units of their prior's standard deviation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.thresholds import EVIDENCE, FIT, SEARCH
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.inference.joint_error import Row, summed
from femupdate.linear import least_squares
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.workers import in_threads

# Responses of one piece of work, among draws and in a Jacobian.
_DRAWS = 32
_COLUMNS = 4


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The unknowns of a model as one vector of d numbers.

    Attributes:
        lower, upper: (d,) limits.
        mean: (d,) of the normal priors.
        precision: (d, d) of them, the inverse of their covariance; 0 where the prior is uniform.
        stories: number of stiffness factors, which come first.
        known_zeta: the damping ratio where it is known; None where ln zeta follows the factors.
        scales, neutral: (q,) of the effects' parameters, which follow.
    """

    lower: Tensor
    upper: Tensor
    mean: Tensor
    precision: Tensor
    stories: int
    known_zeta: float | None
    scales: Tensor
    neutral: Tensor

    def holding(self, values: Tensor) -> "Coordinates":
        """The same with the last unknowns held at values (h,)."""
        first = self.size - len(values)
        lower, upper, precision = self.lower.clone(), self.upper.clone(), self.precision.clone()
        lower[first:], upper[first:] = values, values
        precision[first:], precision[:, first:] = 0.0, 0.0
        return replace(self, lower=lower, upper=upper, precision=precision)

    def about(self, mean: Tensor, covariance: Tensor) -> "Coordinates":
        """The same with a normal prior of that mean (d,) and covariance (d, d)."""
        return replace(self, mean=mean, precision=torch.linalg.inv(covariance))

    def distance(self, z: Tensor) -> Tensor:
        """Squared distance of unknowns z (d,) from the normal priors' means, in their units."""
        away = z - self.mean
        return away @ self.precision @ away

    @property
    def size(self) -> int:
        """d."""
        return len(self.lower)

    @property
    def has_zeta(self) -> bool:
        """Whether the damping ratio is an unknown."""
        return self.known_zeta is None

    @property
    def first_size(self) -> int:
        """Position of the first effect's size."""
        return self.stories + int(self.has_zeta)

    def split(self, z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """theta (N, p), zeta (N,), sizes (N, q) of z (N, d)."""
        theta = z[:, : self.stories].exp()
        if self.known_zeta is None:
            zeta = z[:, self.stories].exp()
        else:
            zeta = z.new_full((len(z),), self.known_zeta)
        count = len(self.scales)
        sizes = self.neutral + self.scales * z[:, self.first_size : self.first_size + count]
        return theta, zeta, sizes

    def joined(self, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """z (N, d) of theta (N, p), zeta (N,) and sizes (N, q)."""
        parts = [theta.log(), (sizes - self.neutral) / self.scales]
        if self.has_zeta:
            parts.insert(1, zeta.log()[:, None])
        return torch.cat(parts, dim=1)


def coordinates(problem: Problem, placed: tuple[Placed, ...]) -> Coordinates:
    """The unknowns of a problem with effects."""
    parameters = [p for one in placed for p in one.effect.parameters]
    scales = torch.tensor([p.scale for p in parameters], dtype=torch.float64)
    neutral = torch.tensor([p.neutral for p in parameters], dtype=torch.float64)
    low = torch.tensor([p.lower for p in parameters], dtype=torch.float64)
    high = torch.tensor([p.upper for p in parameters], dtype=torch.float64)
    factors, damping = problem.prior.of("stiffness"), problem.prior.of("damping")
    free = problem.prior if damping.size else factors
    first, last = free.lower.log(), free.upper.log()
    lower = torch.cat([first, (low - neutral) / scales])
    return Coordinates(
        lower,
        torch.cat([last, (high - neutral) / scales]),
        torch.zeros_like(lower),
        torch.diag(torch.cat([torch.zeros_like(first), torch.ones_like(scales)])),
        factors.size,
        None if damping.size else float(damping.lower),
        scales,
        neutral,
    )


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its most probable parameters, were a row of the table of its errors true.

    Attributes:
        placed: its effects.
        coordinates: what z means.
        z: (d,) the unknowns.
        residual: (m,) whitened by the row.
        jacobian: (m, d) of the prediction by the unknowns, likewise.
        raw: (n,) residuals in the unit of the noise.
        system: the model.
        problem: structure and data, with the row.
    """

    placed: tuple[Placed, ...]
    coordinates: Coordinates
    z: Tensor
    residual: Tensor
    jacobian: Tensor
    raw: Tensor
    system: System
    problem: Problem

    @property
    def known(self) -> Floats:
        """(q,) parameters of the effects at z."""
        c = self.coordinates
        return (c.neutral + c.scales * self.z[c.first_size :]).numpy()

    @property
    def split(self) -> tuple[Tensor, Tensor, Tensor]:
        """theta (1, p), zeta (1,) and sizes (1, q)."""
        return self.coordinates.split(self.z[None])

    @property
    def misfit(self) -> float:
        """What a search lessens: squares by the problem's row, with the distance from priors."""
        return float(self.residual @ self.residual) + self.penalty

    @cached_property
    def densities(self) -> tuple[Tensor, ...]:
        """(g,) log density of every kind of data by every row of its table of errors."""
        return tuple(own[0] for own in self.problem.error.log_densities(self.raw[None]))

    @cached_property
    def left(self) -> Tensor:
        """(m,) residuals of independent points by the noise alone."""
        error = self.problem.error
        return error.whiten(error.tame(self.raw[None], error.first), error.first)[0]

    @property
    def chi2(self) -> float:
        """Sum of squared residuals, of independent points, by the noise alone."""
        return float(self.left @ self.left)

    @property
    def penalty(self) -> float:
        """Squared distance from the normal priors' means, in their standard deviations."""
        return float(self.coordinates.distance(self.z))

    def hessian(self) -> Tensor:
        """(d, d) curvature of minus the log posterior, Gauss and Newton's."""
        return self.jacobian.T @ self.jacobian + self.coordinates.precision

    def covariance(self) -> Tensor:
        """(d, d) of the unknowns."""
        return torch.linalg.pinv(self.hessian(), hermitian=True)

    def within_limits(self) -> Tensor:
        """(d, d) covariance of the unknowns, where what the data leave open fills its limits.

        A uniform density has the variance of its width squared over twelve.
        """
        width = self.coordinates.upper - self.coordinates.lower
        limits = torch.where(
            torch.isfinite(width), 12.0 / width.clamp_min(EVIDENCE.ridge) ** 2, 0.0
        )
        covariance = torch.linalg.inv(self.hessian() + torch.diag(limits))
        ridge = EVIDENCE.ridge * covariance.diagonal().mean()
        whole = torch.eye(len(covariance)).to(covariance)
        return 0.5 * (covariance + covariance.T) + ridge * whole

    def theta(self) -> tuple[Floats, Floats]:
        """Stiffness factors and their standard deviations, (p,) each."""
        count = self.coordinates.stories
        theta = self.z[:count].exp()
        sd = theta * self.covariance().diagonal()[:count].clamp_min(0.0).sqrt()
        return theta.numpy(), sd.numpy()

    def sizes(self) -> tuple[Floats, Floats]:
        """Parameters of the effects and their standard deviations, (q,) each."""
        c = self.coordinates
        variance = c.scales**2 * self.covariance().diagonal()[c.first_size :].clamp_min(0.0)
        own = self.problem.own_errors(self.placed).numpy() * (self.known - c.neutral.numpy())
        return self.known, np.hypot(variance.sqrt().numpy(), own)

    @property
    def zeta(self) -> float:
        """Damping ratio."""
        return float(self.split[1])


def evaluate(problem: Problem, system: System, where: Coordinates, z: Tensor) -> Tensor:
    """Whitened residuals (N, n) at the unknowns z (N, d)."""
    return problem.residuals(system, *where.split(z))


def misfits(problem: Problem, system: System, where: Coordinates, z: Tensor) -> Tensor:
    """Sums of squared residuals (N,) at many unknowns z (N, d), without their priors."""

    def of_some(rows: Tensor) -> Tensor:
        return evaluate(problem, system, where, rows).square().sum(dim=1)

    return torch.cat(in_threads(of_some, z.split(_DRAWS)))


def error_left(problem: Problem, fitted: Fit) -> float:
    """Root mean square of what the factors of a fit leave as if noise were coarse, in ln|H|."""
    rough = coarse(problem)
    split = fitted.split
    missed = rough.missed(rough.system(fitted.placed), split)
    return FIT.coarse_noise * float(missed.square().mean().sqrt())


def raw_residuals(fitted: Fit, z: Tensor) -> Tensor:
    """Residuals (N, n) in the unit of the noise at the unknowns z (N, d) of a fit's model."""
    problem = fitted.problem
    return problem.missed(fitted.system, fitted.coordinates.split(z))


def fit(
    problem: Problem,
    placed: tuple[Placed, ...],
    start: Tensor,
    iterations: int = 15,
    system: System | None = None,
    unknowns: Coordinates | None = None,
    near: Tensor | None = None,
) -> Fit:
    """Fit a model with effects from a starting point z (d,).

    Between the first step and the last the Jacobian is mended by what every step has shown.

    Args:
        problem: structure and data, with the row of the table of errors that is taken for true.
        placed: the effects.
        start: the unknowns.
        iterations: steps, at most.
        system: the model, where it is at hand.
        unknowns: with their priors; by default all that the effects and the problem have.
        near: Jacobian (m, k) by the first unknowns at a point near the start, if known.
    """
    model = system or problem.system(placed)
    where = unknowns or coordinates(problem, placed)
    z = torch.minimum(torch.maximum(start.clone(), where.lower), where.upper)

    def anew(point: _Point) -> _Linear:
        return _Linear(point, _jacobian(problem, model, where, point))

    here = _points(problem, model, where, z[None])[0]
    begun = anew(here) if near is None else _continued(problem, model, where, here, near)
    found = _search(problem, model, where, begun, iterations, _mended, anew)
    reached = found.at
    return Fit(
        placed,
        where,
        reached.z,
        reached.residual,
        found.jacobian,
        reached.raw,
        model,
        problem,
    )


@dataclass(frozen=True, eq=False)
class Begun:
    """A model some steps towards its most probable parameters.

    Attributes:
        placed: its effects.
        z: (d,) the unknowns.
        misfit: what the search lessens (see `Fit.misfit`).
        near: (m, k) Jacobian of the model without the last effect, near z.
    """

    placed: tuple[Placed, ...]
    z: Tensor
    misfit: float
    near: Tensor


def glance(without: Fit, one: Placed, start: Floats, steps: int) -> Begun:
    """Some steps of a fit with one effect more, by the Jacobian of the model without it.

    A fit's own Jacobian costs one response an unknown, at every step. Here only the effect's part
    is made anew; the rest is mended by what every step has shown (Broyden, 1965).

    Args:
        without: the model without the effect, and the problem.
        one: the effect.
        start: its parameters, where the search starts.
        steps: at most.
    """
    problem, placed = without.problem, (*without.placed, one)
    where, model = coordinates(problem, placed), problem.system(placed)
    z = extended(problem, without, placed, np.concatenate([without.known, start]))
    z = torch.minimum(torch.maximum(z, where.lower), where.upper)
    first = len(without.z)
    here = _points(problem, model, where, z[None])[0]
    if not bool(here.residual.isfinite().all()):  # or no structure is left
        return Begun(placed, z, np.inf, without.jacobian)
    begun = _continued(problem, model, where, here, without.jacobian)

    def followed(point: _Point, before: _Linear) -> _Linear:
        mended = _mended(point, before)
        mended.jacobian[:, first:] = _jacobian(problem, model, where, point, first)
        return mended

    found = _search(problem, model, where, begun, steps, followed).at
    return Begun(placed, found.z, _objective(where, found), without.jacobian)


def nearest(problem: Problem, base: Fit, one: Placed, starts: Sequence[Floats]) -> Floats:
    """Which parameters (q,) of an effect more leave least, all else as it was fitted."""
    placed = (*base.placed, one)
    own = [extended(problem, base, placed, np.concatenate([base.known, s])) for s in starts]
    left = evaluate(problem, problem.system(placed), coordinates(problem, placed), torch.stack(own))
    misfit = (left**2).sum(dim=1).nan_to_num(nan=torch.inf)
    return starts[int(misfit.argmin())]


def about(problem: Problem, fitted: Fit) -> Problem:
    """The problem with the errors that are known beforehand as they are about a fit."""
    if problem.left_open is None:
        return problem
    return replace(problem, known=problem.left_open(problem, fitted.placed, *fitted.split))


def settle(problem: Problem, fitted: Fit, steps: int = FIT.steps) -> Fit:
    """The fit by the likeliest row of the table of errors at it, followed until it stays.

    Args:
        problem: structure and data.
        fitted: where the search starts; of any row.
        steps: of each fit, at most.
    """
    for _ in range(FIT.rounds):
        row = likeliest_row(problem, fitted)
        if fitted.problem.row == row and fitted.problem.same_errors(problem):
            break
        same = fitted.problem.reduced is problem.reduced
        model = fitted.system if same else None
        own = fitted.coordinates
        fitted = fit(problem.at_row(row), fitted.placed, fitted.z, steps, model, own)
    return fitted


def narrowed(fitted: Fit) -> Fit:
    """The fit, of a table of errors without rows that no model with an effect more would take.

    What explains more leaves errors no larger, or such as count already.
    """
    error, row = fitted.problem.error, fitted.problem.row
    counting = error.counting([own[None] for own in fitted.densities])
    rows = tuple(
        tuple(sorted({*own, *smaller, 0}))
        for own, smaller in zip(counting, error.no_larger(row), strict=True)
    )
    return replace(fitted, problem=fitted.problem.with_rows(rows))


def likeliest_row(problem: Problem, fitted: Fit) -> Row:
    """Row of every table of errors that residuals make most likely."""
    return tuple(int(own.argmax()) for own in densities(problem, fitted))


def densities(problem: Problem, fitted: Fit) -> tuple[Tensor, ...]:
    """(g,) log density of every kind of data at a fit by every row of its table of errors."""
    if fitted.problem.error is problem.error:
        return fitted.densities
    return tuple(own[0] for own in problem.error.log_densities(fitted.raw[None]))


@dataclass(frozen=True, eq=False)
class _Point:
    """Unknowns z (d,) and the residuals there: in the unit of the noise (n,), and whitened (m,)."""

    z: Tensor
    raw: Tensor
    residual: Tensor


@dataclass(frozen=True, eq=False)
class _Linear:
    """A point, and the Jacobian (m, d) of the prediction there."""

    at: _Point
    jacobian: Tensor
    mended: bool = False


def _points(problem: Problem, system: System, where: Coordinates, z: Tensor) -> list[_Point]:
    """The residuals at unknowns z (N, d)."""
    raw = problem.missed(system, where.split(z))
    return [_Point(*own) for own in zip(z, raw, problem.whitened(raw), strict=True)]


def _objective(where: Coordinates, point: _Point) -> float:
    return float(point.residual @ point.residual + where.distance(point.z))


def _continued(
    problem: Problem, system: System, where: Coordinates, point: _Point, near: Tensor
) -> _Linear:
    """A Jacobian of which the first columns (m, k) are known from near by."""
    others = _jacobian(problem, system, where, point, near.shape[1])
    return _Linear(point, torch.cat([near, others], dim=1), mended=True)


def _mended(point: _Point, before: _Linear) -> _Linear:
    """A Jacobian by what a step has shown (Broyden, 1965)."""
    moved = point.z - before.at.z
    missed = before.at.residual - point.residual - before.jacobian @ moved
    jacobian = before.jacobian + torch.outer(missed / (moved @ moved), moved)
    return _Linear(point, jacobian, mended=True)


def _search(
    problem: Problem,
    system: System,
    where: Coordinates,
    begun: _Linear,
    iterations: int,
    followed: Callable[[_Point, _Linear], _Linear],
    anew: Callable[[_Point], _Linear] | None = None,
) -> _Linear:
    """Levenberg and Marquardt's steps from a point.

    Args:
        problem, system, where: what is fitted.
        begun: the point.
        iterations: steps, at most.
        followed: the Jacobian at a point reached, from that before.
        anew: it without that before: far off, where no step helps and at the end; never if None.
    """
    damping, most = FIT.damping
    now, objective = begun, _objective(where, begun.at)
    for left in reversed(range(iterations)):
        step = _tried(problem, system, where, now, (damping,), objective)
        step = step or _tried(problem, system, where, now, (10 * damping, 100 * damping), objective)
        if step is None and now.mended and anew is not None:
            now = anew(now.at)
            continue
        if step is None:
            damping *= 1000.0
            if damping > most:
                break
            continue
        gain = (objective - step.objective) / max(objective, 1.0)
        objective, damping = step.objective, max(step.damping / 10.0, 1e-6)
        small = gain < FIT.smallest_decrease
        if (small and not now.mended) or (anew is None and (small or not left)):
            return replace(now, at=step.to)
        if anew is not None and (small or gain > FIT.large_decrease):
            now = anew(step.to)
        else:
            now = followed(step.to, now)
    return anew(now.at) if now.mended and anew is not None else now


@dataclass(frozen=True, eq=False)
class _Step:
    """A step that lessens the objective: where it leads, and its damping."""

    to: _Point
    objective: float
    damping: float


def _tried(
    problem: Problem,
    system: System,
    where: Coordinates,
    now: _Linear,
    dampings: tuple[float, ...],
    objective: float,
) -> _Step | None:
    """The best of steps of several lengths, where one lessens the objective."""
    trials = torch.stack([now.at.z + _step(where, now, d) for d in dampings])
    trials = torch.minimum(torch.maximum(trials, where.lower), where.upper)
    found = _points(problem, system, where, trials)
    values = [_objective(where, one) for one in found]
    best = int(np.argmin(values))
    if not values[best] < objective:
        return None
    return _Step(found[best], values[best], dampings[best])


def _jacobian(
    problem: Problem, system: System, where: Coordinates, point: _Point, first: int = 0
) -> Tensor:
    """Change (m, d) of the prediction by the unknowns, by differences into the box.

    Args:
        point: where.
        first: the first of the unknowns.
    """
    z = point.z
    steps = torch.where(z + FIT.difference <= where.upper, FIT.difference, -FIT.difference)[first:]
    if not len(steps):  # an exchange has no size
        return point.residual.new_zeros(len(point.residual), 0)
    points = z.repeat(len(steps), 1)
    points[:, first:] += torch.diag(steps)
    some = partial(evaluate, problem, system, where)
    residuals = torch.cat(in_threads(some, points.split(_COLUMNS)))
    return ((point.residual - residuals) / steps[:, None]).T


def _step(where: Coordinates, now: _Linear, damping: float) -> Tensor:
    """Damped Gauss-Newton step that leaves alone what is held at its limit."""
    z, residual, jacobian = now.at.z, now.at.residual, now.jacobian
    gradient = jacobian.T @ residual - where.precision @ (z - where.mean)
    held = ((z <= where.lower) & (gradient < 0)) | ((z >= where.upper) & (gradient > 0))
    free = (~held).nonzero()[:, 0]
    normal = jacobian.T @ jacobian + where.precision
    normal = normal[free][:, free]
    ridge = damping * torch.diag(normal.diagonal().clamp_min(1e-6))
    step = torch.zeros_like(z)
    step[free] = least_squares(normal + ridge, gradient[free])
    return step.clamp(-1.0, 1.0)


def fit_baseline(
    problem: Problem,
    placed: tuple[Placed, ...] = (),
    sizes: tuple[float, ...] = (),
    seed: int = 0,
    samples: int = FIT.baseline_draws,
    starts: int = FIT.baseline_starts,
) -> list[Fit]:
    """Fit a model from the best of many draws of its prior, best first.

    Where much is left, either the model lacks something or the search ended beside the highest
    maximum. Further draws tell: it goes on until two searches end at the same place.

    Args:
        problem: structure and data.
        placed: effects that the model has already.
        sizes: their parameters, where the search starts.
        seed: of the draws.
        samples: draws of stiffness factors and damping ratio.
        starts: how many of them are fitted.
    """
    where, system = coordinates(problem, placed), problem.system(placed)
    known = (torch.tensor(sizes, dtype=torch.float64) - where.neutral) / where.scales

    def found(stream: Seed) -> list[Fit]:
        z = prior_draws(problem, where, known, samples, stream)
        return _fitted_draws(problem, placed, system, z, starts)

    fits = found(seed)
    for stream in spawn(seed, FIT.baseline_again):
        if error_left(problem, fits[0]) < SEARCH.right:
            break
        best, further = log_posterior(problem, fits[0]), found(stream)
        fits = _best_first(problem, [*fits, *further])
        if abs(log_posterior(problem, further[0]) - best) < FIT.same_maximum:
            break
    return fits


def _fitted_draws(
    problem: Problem, placed: tuple[Placed, ...], system: System, z: Tensor, starts: int
) -> list[Fit]:
    """Fits from the best of unknowns z (N, d), best first."""
    # Far from the data every point is many times the noise off, whichever way is better: first
    # they are compared as if they were coarse.
    rough = coarse(problem)
    misfit = misfits(rough, system, coordinates(problem, placed), z)
    roughly = partial(fit, rough, placed, iterations=FIT.rough_steps, system=system)
    near = in_threads(roughly, z[misfit.argsort()[:starts]])
    near.sort(key=lambda one: one.misfit)
    # No few points decide while the model may err much.
    wide = problem.at_row(problem.error.start)

    def settled(one: Fit) -> Fit:
        return settle(problem, fit(wide, placed, one.z, FIT.far_steps, system))

    return _best_first(problem, in_threads(settled, near[: max(2, starts // 3)]))


def _best_first(problem: Problem, fits: list[Fit]) -> list[Fit]:
    return sorted(fits, key=lambda one: -log_posterior(problem, one))


def log_posterior(problem: Problem, fitted: Fit) -> float:
    """Log density of data and normal priors at a fit, summed over the table of errors."""
    return float(summed(densities(problem, fitted))) - 0.5 * fitted.penalty


def prior_draws(
    problem: Problem, where: Coordinates, known: Tensor, count: int, seed: Seed
) -> Tensor:
    """Unknowns (count, d) with theta and zeta drawn from the prior, the others (q,) as known."""
    generator = torch_generator(seed)
    drawn = problem.prior.sample(count, generator)[:, : where.first_size]
    return torch.cat([drawn.log(), known.expand(count, -1)], dim=1)


def coarse(problem: Problem) -> Problem:
    """The problem as if its noise were coarse, and every point erred alone."""
    return problem.coarse(FIT.coarse_noise)


def extended(problem: Problem, base: Fit, placed: tuple[Placed, ...], sizes: Floats) -> Tensor:
    """Unknowns of a model with effects: those of the base fit, with given effect parameters."""
    where = coordinates(problem, placed)
    first = base.coordinates.first_size
    own = (torch.from_numpy(np.asarray(sizes, dtype=np.float64)) - where.neutral) / where.scales
    return torch.cat([base.z[:first], own])
