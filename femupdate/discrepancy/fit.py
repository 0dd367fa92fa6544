"""Most probable parameters of a model with effects, by Levenberg and Marquardt's method.

What the model errs by is learned with them: a fit takes one row of the table of
`inference.model_error` for true, and the row that its residuals make likeliest is taken next.

The unknowns are ln theta and ln zeta (uniform priors on a box) and the sizes of the effects in
units of their prior's standard deviation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.thresholds import EVIDENCE, FIT, SEARCH
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.inference.joint_error import Row, summed
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.parameters import LogSteps, own_errors
from femupdate.maximise import Search, maximise
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.workers import in_threads

# Responses of one piece of work, among draws and in a Jacobian.
_DRAWS = 32
_COLUMNS = 4


@dataclass(frozen=True, eq=False)
class _Target:
    """A likelihood and priors as a search lessens them."""

    likelihood: Likelihood
    steps: LogSteps

    @property
    def lower(self) -> Tensor:
        return self.steps.lower

    @property
    def upper(self) -> Tensor:
        return self.steps.upper

    @property
    def mean(self) -> Tensor:
        return self.steps.mean

    @property
    def precision(self) -> Tensor:
        return self.steps.precision

    def raw(self, z: Tensor) -> Tensor:
        return self.likelihood.raw(self.steps.values(z))

    def whitened(self, raw: Tensor) -> Tensor:
        return self.likelihood.whitened(raw)

    def derivative(self, z: Tensor, residual: Tensor, first: int) -> Tensor:
        """By differences into the box."""
        step = torch.where(z + FIT.difference <= self.upper, FIT.difference, -FIT.difference)
        count = z.shape[1] - first
        if not count:  # an exchange has no size
            return residual.new_zeros(*residual.shape, 0)
        moved = (z[:, None] + torch.diag_embed(step)[:, first:]).flatten(0, 1)
        parts = in_threads(lambda some: self.whitened(self.raw(some)), moved.split(_COLUMNS))
        there = torch.cat(parts).view(len(z), count, -1)
        return ((residual[:, None] - there) / step[:, first:, None]).mT


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its most probable parameters, were a row of the table of its errors true.

    Attributes:
        likelihood: of the data by the model, with the row.
        steps: what z means, and its priors.
        z: (d,) the unknowns.
        residual: (m,) whitened by the row.
        jacobian: (m, d) of the prediction by the unknowns, likewise.
        raw: (n,) residuals in the unit of the noise.
    """

    likelihood: Likelihood
    steps: LogSteps
    z: Tensor
    residual: Tensor
    jacobian: Tensor
    raw: Tensor

    @property
    def system(self) -> System:
        """The model."""
        return self.likelihood.system

    @property
    def placed(self) -> tuple[Placed, ...]:
        """Its effects."""
        return self.system.placed

    @property
    def known(self) -> Floats:
        """(q,) parameters of the effects at z."""
        return np.asarray(self.split[2][0].numpy())

    @property
    def parameters(self) -> Tensor:
        """(1, p) all parameters, in the order of the likelihood's."""
        return self.steps.values(self.z[None])

    @property
    def split(self) -> tuple[Tensor, Tensor, Tensor]:
        """theta (1, p), zeta (1,) and sizes (1, q)."""
        return self.steps.split(self.z[None])

    @property
    def misfit(self) -> float:
        """What a search lessens: squares by the row, with the distance from priors."""
        return float(self.residual @ self.residual) + self.penalty

    @cached_property
    def densities(self) -> tuple[Tensor, ...]:
        """(g,) log density of every kind of data by every row of its table of errors."""
        return tuple(own[0] for own in self.likelihood.error.log_densities(self.raw[None]))

    @property
    def chi2(self) -> float:
        """Sum of squared residuals, of independent points, by the noise alone."""
        error = self.likelihood.error
        left = error.whiten(error.tame(self.raw[None], error.first), error.first)[0]
        return float(left @ left)

    @property
    def penalty(self) -> float:
        """Squared distance from the normal priors' means, in their standard deviations."""
        return float(self.steps.distance(self.z))

    def hessian(self) -> Tensor:
        """(d, d) curvature of minus the log posterior, Gauss and Newton's."""
        return self.jacobian.T @ self.jacobian + self.steps.precision

    def covariance(self) -> Tensor:
        """(d, d) of the unknowns."""
        return torch.linalg.pinv(self.hessian(), hermitian=True)

    def within_limits(self) -> Tensor:
        """(d, d) covariance of the unknowns, where what the data leave open fills its limits.

        A uniform density has the variance of its width squared over twelve.
        """
        width = self.steps.upper - self.steps.lower
        limits = torch.where(
            torch.isfinite(width), 12.0 / width.clamp_min(EVIDENCE.ridge) ** 2, 0.0
        )
        covariance = torch.linalg.inv(self.hessian() + torch.diag(limits))
        ridge = EVIDENCE.ridge * covariance.diagonal().mean()
        whole = torch.eye(len(covariance)).to(covariance)
        return 0.5 * (covariance + covariance.T) + ridge * whole

    def theta(self) -> tuple[Floats, Floats]:
        """Stiffness factors and their standard deviations, (p,) each."""
        count = self.steps.stories
        theta = self.z[:count].exp()
        sd = theta * self.covariance().diagonal()[:count].clamp_min(0.0).sqrt()
        return theta.numpy(), sd.numpy()

    def sizes(self) -> tuple[Floats, Floats]:
        """Parameters of the effects and their standard deviations, (q,) each."""
        steps = self.steps
        variance = self.covariance().diagonal()[steps.first_size :].clamp_min(0.0)
        away = self.known - steps.centres.numpy()
        own = own_errors(self.placed, self.likelihood.building) * away
        return self.known, np.hypot((steps.scales * variance.sqrt()).numpy(), own)

    @property
    def zeta(self) -> float:
        """Damping ratio."""
        return float(self.split[1])


def misfits(likelihood: Likelihood, z: Tensor) -> Tensor:
    """Sums of squared residuals (N,) at many unknowns z (N, d), without their priors."""
    target = _Target(likelihood, likelihood.prior.steps)

    def of_some(rows: Tensor) -> Tensor:
        return target.whitened(target.raw(rows)).square().sum(dim=1)

    return torch.cat(in_threads(of_some, z.split(_DRAWS)))


def error_left(likelihood: Likelihood, fitted: Fit) -> float:
    """Root mean square of what the factors of a fit leave as if noise were coarse, in ln|H|."""
    rough = coarse(likelihood).with_effects(fitted.placed)
    return FIT.coarse_noise * float(rough.raw(fitted.parameters).square().mean().sqrt())


def raw_residuals(fitted: Fit, z: Tensor) -> Tensor:
    """Residuals (N, n) in the unit of the noise at the unknowns z (N, d) of a fit's model."""
    return fitted.likelihood.raw(fitted.steps.values(z))


def fit(
    likelihood: Likelihood,
    placed: tuple[Placed, ...],
    start: Tensor,
    iterations: int = FIT.steps,
    steps: LogSteps | None = None,
    near: Tensor | None = None,
) -> Fit:
    """Fit a model with effects from a starting point z (d,).

    Between the first step and the last the Jacobian is mended by what every step has shown.

    Args:
        likelihood: of the data, with the row of the table of errors that is taken for true.
        placed: the effects.
        start: the unknowns.
        iterations: steps, at most.
        steps: the unknowns with their priors; by default those of the likelihood's prior.
        near: Jacobian (m, k) by the first unknowns at a point near the start, if known.
    """
    own = likelihood.with_effects(placed)
    target = _Target(own, steps or own.prior.steps)
    how = Search(
        iterations=iterations,
        small=FIT.smallest_decrease,
        most_damping=FIT.most_damping,
        longest=1.0,
        mended=True,
    )
    found = maximise(target, start[None], how, near)
    return Fit(own, target.steps, found.z[0], found.residual[0], found.jacobian[0], found.raw[0])


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
    is made anew; the rest is mended by what every step has shown.

    Args:
        without: the model without the effect, and the data.
        one: the effect.
        start: its parameters, where the search starts.
        steps: at most.
    """
    placed = (*without.placed, one)
    own = without.likelihood.with_effects(placed)
    z = extended(own, without, placed, np.concatenate([without.known, start]))
    how = Search(
        iterations=steps,
        small=FIT.smallest_decrease,
        most_damping=FIT.most_damping,
        longest=1.0,
        mended=True,
        renewed=False,
        fresh=len(without.z),
    )
    found = maximise(_Target(own, own.prior.steps), z[None], how, without.jacobian)
    # There may be no structure left.
    misfit = float(found.objective[0].nan_to_num(nan=torch.inf))
    return Begun(placed, found.z[0], misfit, without.jacobian)


def nearest(likelihood: Likelihood, base: Fit, one: Placed, starts: Sequence[Floats]) -> Floats:
    """Which parameters (q,) of an effect more leave least, all else as it was fitted."""
    placed = (*base.placed, one)
    own = [extended(likelihood, base, placed, np.concatenate([base.known, s])) for s in starts]
    left = misfits(likelihood.with_effects(placed), torch.stack(own)).nan_to_num(nan=torch.inf)
    return starts[int(left.argmin())]


def about(likelihood: Likelihood, fitted: Fit) -> Likelihood:
    """The likelihood beside the errors that are known beforehand as they are about a fit."""
    own = likelihood.with_effects(fitted.placed).about(fitted.parameters)
    return replace(likelihood, error=own.error)


def settle(likelihood: Likelihood, fitted: Fit, iterations: int = FIT.steps) -> Fit:
    """The fit by the likeliest row of the table of errors at it, followed until it stays.

    Args:
        likelihood: of the data.
        fitted: where the search starts; of any row.
        iterations: of each fit, at most.
    """
    same = fitted.likelihood.reduced is likelihood.reduced
    own = likelihood.of(fitted.likelihood) if same else likelihood
    for _ in range(FIT.rounds):
        row = likeliest_row(likelihood, fitted)
        if fitted.likelihood.row == row and fitted.likelihood.error is likelihood.error:
            break
        fitted = fit(own.at_row(row), fitted.placed, fitted.z, iterations, fitted.steps)
    return fitted


def narrowed(fitted: Fit) -> Fit:
    """The fit, of a table of errors without rows that no model with an effect more would take.

    What explains more leaves errors no larger, or such as count already.
    """
    error, row = fitted.likelihood.error, fitted.likelihood.row
    counting = error.counting([own[None] for own in fitted.densities])
    rows = tuple(
        tuple(sorted({*own, *smaller, 0}))
        for own, smaller in zip(counting, error.no_larger(row), strict=True)
    )
    return replace(fitted, likelihood=fitted.likelihood.kept(rows))


def likeliest_row(likelihood: Likelihood, fitted: Fit) -> Row:
    """Row of every table of errors that residuals make most likely."""
    return tuple(int(own.argmax()) for own in densities(likelihood, fitted))


def densities(likelihood: Likelihood, fitted: Fit) -> tuple[Tensor, ...]:
    """(g,) log density of every kind of data at a fit by every row of its table of errors."""
    if fitted.likelihood.error is likelihood.error:
        return fitted.densities
    return tuple(own[0] for own in likelihood.error.log_densities(fitted.raw[None]))


def fit_baseline(
    likelihood: Likelihood,
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
        likelihood: of the data by a model without effects.
        placed: effects that the model has already.
        sizes: their parameters, where the search starts.
        seed: of the draws.
        samples: draws of stiffness factors and damping ratio.
        starts: how many of them are fitted.
    """
    own = likelihood.with_effects(placed)
    known = own.prior.steps.sizes(sizes)

    def found(stream: Seed) -> list[Fit]:
        return _fitted_draws(own, prior_draws(own, known, samples, stream), starts)

    fits = found(seed)
    for stream in spawn(seed, FIT.baseline_again):
        if error_left(likelihood, fits[0]) < SEARCH.right:
            break
        best, further = log_posterior(likelihood, fits[0]), found(stream)
        fits = _best_first(likelihood, [*fits, *further])
        if abs(log_posterior(likelihood, further[0]) - best) < FIT.same_maximum:
            break
    return fits


def _fitted_draws(likelihood: Likelihood, z: Tensor, starts: int) -> list[Fit]:
    """Fits from the best of unknowns z (N, d), best first."""
    # Far from the data every point is many times the noise off, whichever way is better: first
    # they are compared as if they were coarse.
    placed = likelihood.system.placed
    rough = coarse(likelihood).with_effects(placed)
    misfit = misfits(rough, z)
    roughly = partial(fit, rough, placed, iterations=FIT.rough_steps)
    near = in_threads(roughly, z[misfit.argsort()[:starts]])
    near.sort(key=lambda one: one.misfit)
    # No few points decide while the model may err much.
    wide = likelihood.at_row(likelihood.error.start)

    def settled(one: Fit) -> Fit:
        return settle(likelihood, fit(wide, placed, one.z, FIT.far_steps))

    return _best_first(likelihood, in_threads(settled, near[: max(2, starts // 3)]))


def _best_first(likelihood: Likelihood, fits: list[Fit]) -> list[Fit]:
    return sorted(fits, key=lambda one: -log_posterior(likelihood, one))


def log_posterior(likelihood: Likelihood, fitted: Fit) -> float:
    """Log density of data and normal priors at a fit, summed over the table of errors."""
    return float(summed(densities(likelihood, fitted))) - 0.5 * fitted.penalty


def prior_draws(likelihood: Likelihood, known: Tensor, count: int, seed: Seed) -> Tensor:
    """Unknowns (count, d) with theta and zeta drawn from the prior, the others (q,) as known."""
    generator = torch_generator(seed)
    prior = likelihood.prior
    drawn = prior.of("stiffness", "damping").sample(count, generator)[:, : prior.steps.first_size]
    return torch.cat([drawn.log(), known.expand(count, -1)], dim=1)


def coarse(likelihood: Likelihood) -> Likelihood:
    """The same on fewer shapes as if noise were coarse and every point erred alone; no effects."""
    return likelihood.on_fewer(FIT.fewer_shapes).coarse(FIT.coarse_noise)


def extended(
    likelihood: Likelihood, base: Fit, placed: tuple[Placed, ...], sizes: Floats
) -> Tensor:
    """Unknowns of a model with effects: those of the base fit, with given effect parameters."""
    own = likelihood.with_effects(placed).prior.steps.sizes(sizes)
    return torch.cat([base.z[: base.steps.first_size], own])
