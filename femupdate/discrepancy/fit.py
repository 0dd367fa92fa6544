"""Most probable parameters of a model with effects, by Levenberg and Marquardt's method.

The unknowns are ln theta and ln zeta (uniform priors on a box) and the sizes of the effects in
units of their prior's standard deviation.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.common_errors import CommonErrors
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.thresholds import FIT
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.linear import least_squares
from femupdate.seeds import Seed, torch_generator


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The unknowns of a model as one vector of d numbers.

    Attributes:
        lower, upper: (d,) limits.
        mean, precision: (d,) of the normal priors; precision 0 where the prior is uniform.
        stories: number of stiffness factors, which come first.
        has_zeta: whether ln zeta follows them.
        scales, neutral: (q,) of the effects' parameters, which follow.
    """

    lower: Tensor
    upper: Tensor
    mean: Tensor
    precision: Tensor
    stories: int
    has_zeta: bool
    scales: Tensor
    neutral: Tensor

    @property
    def size(self) -> int:
        """d."""
        return len(self.lower)

    @property
    def first_size(self) -> int:
        """Position of the first effect's size."""
        return self.stories + int(self.has_zeta)

    def split(self, z: Tensor, fixed_zeta: float) -> tuple[Tensor, Tensor, Tensor]:
        """theta (N, p), zeta (N,), sizes (N, q) of z (N, d)."""
        theta = z[:, : self.stories].exp()
        zeta = z.new_full((len(z),), fixed_zeta)
        if self.has_zeta:
            zeta = z[:, self.stories].exp()
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
    lower, upper = [problem.lower.log()], [problem.upper.log()]
    mean, precision = [torch.zeros_like(problem.lower)], [torch.zeros_like(problem.lower)]
    if problem.zeta is not None:
        bounds = torch.tensor(problem.zeta, dtype=torch.float64).log()
        lower.append(bounds[:1])
        upper.append(bounds[1:])
        mean.append(torch.zeros(1, dtype=torch.float64))
        precision.append(torch.zeros(1, dtype=torch.float64))
    lower.append((low - neutral) / scales)
    upper.append((high - neutral) / scales)
    mean.append(torch.zeros_like(scales))
    precision.append(torch.ones_like(scales))
    return Coordinates(
        torch.cat(lower),
        torch.cat(upper),
        torch.cat(mean),
        torch.cat(precision),
        len(problem.lower),
        problem.zeta is not None,
        scales,
        neutral,
    )


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its most probable parameters, as if every point erred alone.

    What is said of it (`chi2`, `theta` and all below them) is of the fit with `common` as part of
    the noise, one step of generalised least squares from here. Not more than a step: where errors
    are as large as a peak is wide, a search would go wherever straight lines best hide a misfit.

    Attributes:
        placed: its effects.
        coordinates: what z means.
        z: (d,) the unknowns.
        residual: (n,) whitened.
        jacobian: (n, d) of the prediction by the unknowns, whitened.
        system: the model.
        common: errors that many points share, about here; or None.
        own_error: share of an effect's size by which the model of the effect may err.
    """

    placed: tuple[Placed, ...]
    coordinates: Coordinates
    z: Tensor
    residual: Tensor
    jacobian: Tensor
    system: System
    common: CommonErrors | None = None
    own_error: float = 0.0

    @cached_property
    def weighed(self) -> "Fit":
        """The fit with the common errors as part of the noise."""
        if self.common is None:
            return self
        where = self.coordinates
        residual = self.common.whiten(self.residual[None])[0]
        jacobian = self.common.whiten(self.jacobian.T).T
        step = _step(where, self.z, residual, jacobian, 0.0)
        z = torch.minimum(torch.maximum(self.z + step, where.lower), where.upper)
        left = residual - jacobian @ (z - self.z)
        return replace(self, z=z, residual=left, jacobian=jacobian, common=None)

    @property
    def known(self) -> Floats:
        """(q,) parameters of the effects at z."""
        c = self.coordinates
        return (c.neutral + c.scales * self.z[c.first_size :]).numpy()

    @property
    def misfit(self) -> float:
        """What a search lessens: as if every point erred alone, with the distance from priors."""
        c = self.coordinates
        return float(self.residual @ self.residual + (c.precision * (self.z - c.mean) ** 2).sum())

    @property
    def chi2(self) -> float:
        """Sum of squared residuals, of independent points."""
        return float(self.weighed.residual @ self.weighed.residual)

    @property
    def penalty(self) -> float:
        """Squared distance from the normal priors' means, in their standard deviations."""
        c = self.coordinates
        return float((c.precision * (self.weighed.z - c.mean) ** 2).sum())

    def hessian(self, inflation: float = 1.0) -> Tensor:
        """(d, d) curvature of minus the log posterior, Gauss and Newton's."""
        jacobian = self.weighed.jacobian
        return jacobian.T @ jacobian / inflation + torch.diag(self.coordinates.precision)

    def covariance(self, inflation: float = 1.0) -> Tensor:
        """(d, d) of the unknowns, for a noise of `inflation` times the stated variance."""
        return torch.linalg.pinv(self.hessian(inflation), hermitian=True)

    def theta(self, inflation: float = 1.0) -> tuple[Floats, Floats]:
        """Stiffness factors and their standard deviations, (p,) each."""
        count = self.coordinates.stories
        theta = self.weighed.z[:count].exp()
        sd = theta * self.covariance(inflation).diagonal()[:count].clamp_min(0.0).sqrt()
        return theta.numpy(), sd.numpy()

    def sizes(self, inflation: float = 1.0) -> tuple[Floats, Floats]:
        """Parameters of the effects and their standard deviations, (q,) each."""
        c = self.coordinates
        known = self.weighed.known
        variance = c.scales**2 * self.covariance(inflation).diagonal()[c.first_size :].clamp_min(
            0.0
        )
        return known, np.hypot(
            variance.sqrt().numpy(), self.own_error * (known - c.neutral.numpy())
        )

    def zeta(self, fixed: float) -> float:
        """Damping ratio."""
        if not self.coordinates.has_zeta:
            return fixed
        return float(self.weighed.z[self.coordinates.stories].exp())


def evaluate(problem: Problem, system: System, where: Coordinates, z: Tensor) -> Tensor:
    """Whitened residuals (N, n) at the unknowns z (N, d)."""
    return problem.residuals(system, *where.split(z, problem.fixed_zeta))


def weighed_residuals(problem: Problem, fitted: Fit, z: Tensor) -> Tensor:
    """Residuals (N, n) about a fit, at the unknowns z (N, d), of unit covariance.

    With common errors along straight lines: over the tenths of a percent by which those of a mesh
    move the unknowns, responses are straight.
    """
    if fitted.common is None:
        return evaluate(problem, fitted.system, fitted.coordinates, z)
    centre = fitted.weighed
    return centre.residual - (z - centre.z) @ centre.jacobian.T


def fit(
    problem: Problem,
    placed: tuple[Placed, ...],
    start: Tensor,
    iterations: int = 15,
    system: System | None = None,
) -> Fit:
    """Fit a model with effects from a starting point z (d,)."""
    model = system or problem.system(placed)
    where = coordinates(problem, placed)
    z = torch.minimum(torch.maximum(start.clone(), where.lower), where.upper)
    residual, jacobian = _linearise(problem, model, where, z)
    objective = _objective(where, z, residual)
    damping = 1e-2
    for _ in range(iterations):
        step = _step(where, z, residual, jacobian, damping)
        # Three lengths of step at once cost little more than one.
        dampings = [damping, 10.0 * damping, 100.0 * damping]
        trials = torch.stack(
            [z + step, *(z + _step(where, z, residual, jacobian, d) for d in dampings[1:])]
        )
        trials = torch.minimum(torch.maximum(trials, where.lower), where.upper)
        found = evaluate(problem, model, where, trials)
        values = [_objective(where, t, r) for t, r in zip(trials, found, strict=True)]
        best = int(np.argmin(values))
        if not values[best] < objective:
            damping *= 1000.0
            if damping > 1e6:
                break
            continue
        gain = (objective - values[best]) / max(objective, 1.0)
        z, objective = trials[best], values[best]
        damping = max(dampings[best] / 10.0, 1e-6)
        residual, jacobian = _linearise(problem, model, where, z)
        if gain < FIT.smallest_decrease:
            break
    common = None
    if problem.left_open is not None:
        at = where.split(z[None], problem.fixed_zeta)
        common = CommonErrors.of(problem.left_open(problem, placed, *at).T)
    return Fit(placed, where, z, residual, jacobian, model, common, problem.own_error)


def _objective(where: Coordinates, z: Tensor, residual: Tensor) -> float:
    return float(residual @ residual + (where.precision * (z - where.mean) ** 2).sum())


def _linearise(
    problem: Problem, system: System, where: Coordinates, z: Tensor
) -> tuple[Tensor, Tensor]:
    """Residuals (n,) and Jacobian of the prediction (n, d), by differences into the box."""
    steps = torch.where(z + FIT.difference <= where.upper, FIT.difference, -FIT.difference)
    points = torch.cat([z[None], z + torch.diag(steps)])
    residuals = evaluate(problem, system, where, points)
    return residuals[0], (-(residuals[1:] - residuals[0]) / steps[:, None]).T


def _step(
    where: Coordinates, z: Tensor, residual: Tensor, jacobian: Tensor, damping: float
) -> Tensor:
    """Damped Gauss-Newton step that leaves alone what is held at its limit."""
    gradient = jacobian.T @ residual - where.precision * (z - where.mean)
    held = ((z <= where.lower) & (gradient < 0)) | ((z >= where.upper) & (gradient > 0))
    free = (~held).nonzero()[:, 0]
    normal = jacobian.T @ jacobian + torch.diag(where.precision)
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
    z = prior_draws(problem, where, known, samples, seed)
    # Far from the data every point is many times the noise off, whichever way is better: first
    # they are compared as if they were coarse.
    rough = coarse(problem)
    misfit = (evaluate(rough, system, where, z) ** 2).sum(dim=1)
    near = [fit(rough, placed, z[k], 10, system) for k in misfit.argsort()[:starts]]
    near.sort(key=lambda one: one.chi2 + one.penalty)
    fits = [fit(problem, placed, one.z, 25, system) for one in near[: max(2, starts // 3)]]
    return sorted(fits, key=lambda one: one.chi2 + one.penalty)


def prior_draws(
    problem: Problem, where: Coordinates, known: Tensor, count: int, seed: Seed
) -> Tensor:
    """Unknowns (count, d) with theta and zeta drawn from the prior, the others (q,) as known."""
    generator = torch_generator(seed)
    unit = torch.rand(count, where.first_size, generator=generator, dtype=torch.float64)
    stories = where.stories
    # The priors are uniform in theta and zeta themselves.
    theta = problem.lower + (problem.upper - problem.lower) * unit[:, :stories]
    parts = [theta.log()]
    if where.has_zeta:
        low, high = where.lower[stories].exp(), where.upper[stories].exp()
        parts.append((low + (high - low) * unit[:, stories:]).log())
    return torch.cat([*parts, known.expand(count, -1)], dim=1)


def coarse(problem: Problem) -> Problem:
    """The problem as if its noise were coarse, and every point erred alone."""
    return replace(problem.on_fewer(), sd=(problem.sd**2 + FIT.coarse_noise**2).sqrt())


def extended(problem: Problem, base: Fit, placed: tuple[Placed, ...], sizes: Floats) -> Tensor:
    """Unknowns of a model with effects: those of the base fit, with given effect parameters."""
    where = coordinates(problem, placed)
    first = base.coordinates.first_size
    own = (torch.from_numpy(np.asarray(sizes, dtype=np.float64)) - where.neutral) / where.scales
    return torch.cat([base.z[:first], own])
