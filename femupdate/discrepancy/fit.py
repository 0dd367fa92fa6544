"""Most probable parameters of a model with effects, and what they leave unexplained.

What the model errs by is learned with them: a fit takes one row of the table of
`inference.model_error` for true, and the row that its residuals make likeliest is taken next.

The unknowns are ln theta and ln zeta (uniform priors on a box) and the sizes of the effects in
units of their prior's standard deviation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from scipy.special import chdtrc
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.effects.tolerances import tolerance_of
from femupdate.inference.likelihood import Likelihood, Row, summed
from femupdate.inference.maxima import COARSE_NOISE
from femupdate.inference.model_error import Cell, Remains
from femupdate.inference.parameters import LogSteps, effect_parameters, own_errors
from femupdate.maximise import Search, maximise
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.workers import in_threads

FIRST_STEPS, STEPS, FAR_STEPS = 5, 15, 60  # of every candidate, of one that is followed, from afar
DIFFERENCE = 1e-3  # of an unknown, for derivatives
FEWER_SHAPES = 140  # of a basis in searches: ln|H| errs by .01 rms, in a third of the time
RIGHT = 0.1  # in ln|H| rms, left by factors alone: less, and they are where they should be
_SEARCH = Search(small=1e-4, longest=1.0, mended=True)


class _Target:
    """A likelihood and priors as a search lessens them."""

    def __init__(self, likelihood: Likelihood, steps: LogSteps) -> None:
        self._likelihood, self.steps = likelihood, steps
        self.lower, self.upper = steps.lower, steps.upper
        self.mean, self.precision = steps.mean, steps.precision

    def raw(self, z: Tensor) -> Tensor:
        return self._likelihood.raw(self.steps.values(z))

    def whitened(self, raw: Tensor) -> Tensor:
        return self._likelihood.whitened(raw)

    def derivative(self, z: Tensor, residual: Tensor, first: int) -> Tensor:
        """By differences into the box."""
        step, moved = self._moved(z, first)
        if not moved.numel():  # an exchange has no size
            return residual.new_zeros(*residual.shape, 0)
        there = self._both(moved)[1]
        return ((residual[:, None] - there) / step).mT

    def with_derivative(self, z: Tensor, first: int) -> tuple[Tensor, Tensor, Tensor]:
        """Of small models a call costs more than its rows."""
        step, moved = self._moved(z, first)
        raw, there = self._both(torch.cat([z[:, None], moved], dim=1))
        return raw[:, 0], there[:, 0], ((there[:, :1] - there[:, 1:]) / step).mT

    def _moved(self, z: Tensor, first: int) -> tuple[Tensor, Tensor]:
        step = torch.where(z + DIFFERENCE <= self.upper, DIFFERENCE, -DIFFERENCE)
        return step[:, first:, None], z[:, None] + torch.diag_embed(step)[:, first:]

    def _both(self, z: Tensor) -> list[Tensor]:
        """Residuals (s, c, n) at z (s, c, d), and the same whitened."""

        def both(rows: Tensor) -> tuple[Tensor, Tensor]:
            raw = self.raw(rows)
            return raw, self.whitened(raw)

        parts = z.flatten(0, 1).split(max(4, 256 // self._likelihood.system.model.size))
        found = in_threads(both, parts) if len(parts) > 1 else [both(parts[0])]
        return [torch.cat(kind).unflatten(0, z.shape[:2]) for kind in zip(*found, strict=True)]


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

    def known_of(self, number: int) -> Floats:
        """Those of one effect, -1 for the last."""
        counts = [len(placed.effect.parameters) for placed in self.placed]
        return np.split(self.known, np.cumsum(counts)[:-1])[number]

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
        """What a search lessens; infinite where no structure is left."""
        square = (self.residual @ self.residual).nan_to_num(nan=torch.inf)
        return float(square) + self.penalty

    @cached_property
    def densities(self) -> tuple[Tensor, ...]:
        """(g,) log density of every kind of data by every row of its table of errors."""
        return _log_densities(self.likelihood, self.raw)

    @property
    def chi2(self) -> float:
        """Sum of squared residuals, of independent points, by the noise alone."""
        error = self.likelihood.error
        left = error.whiten(error.tame(self.raw[None], error.first), error.first)[0]
        return float((left @ left).nan_to_num(nan=torch.inf))

    @property
    def p_value(self) -> float:
        """Probability that noise alone leaves residuals as large as these."""
        return float(chdtrc(max(self.likelihood.effective - self.steps.size, 1.0), self.chi2))

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
        ridge = 1e-12  # so that rounding cannot make a covariance indefinite
        width = self.steps.upper - self.steps.lower
        limits = torch.where(torch.isfinite(width), 12.0 / width.clamp_min(ridge) ** 2, 0.0)
        covariance = torch.linalg.inv(self.hessian() + torch.diag(limits))
        whole = torch.eye(len(covariance)).to(covariance)
        return 0.5 * (covariance + covariance.T) + ridge * covariance.diagonal().mean() * whole

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
        away = self.known - steps.parameters.centres.numpy()
        share = own_errors(self.placed, self.likelihood.building) * away
        return self.known, np.hypot((steps.parameters.scales * variance.sqrt()).numpy(), share)

    @property
    def last_size(self) -> tuple[float, float]:
        """First parameter of the last effect and its standard deviation; 1 and 0 without any."""
        count = len(self.placed[-1].effect.parameters)
        size, sd = (float(values[-count]) for values in self.sizes()) if count else (1.0, 0.0)
        return size, sd

    @property
    def zeta(self) -> float:
        """Damping ratio."""
        return float(self.split[1])

    def remains(self) -> Remains:
        """What is left beside noise, by the rows of the tables of errors that were taken for true.

        Of several kinds of data, where most is left; the sentence tells of all.
        """
        of, error = self.likelihood, self.likelihood.error
        parts = zip(of.data, error.parts, of.row, error.apart(self.raw[None]), strict=True)
        left = [data.remains(table, row, raw[0]) for data, table, row, raw in parts]
        sentences = dict.fromkeys(kind.sentence for kind in left if kind.sentence)
        return replace(max(left, key=lambda kind: kind.size), sentence=" ".join(sentences))

    def cells(self) -> tuple[Cell, ...]:
        """Mean squared residual of every part of the data, by the noise alone."""
        of, cells = self.likelihood, list[Cell]()
        for data, table, raw in zip(
            of.data, of.error.parts, of.error.apart(self.raw[None]), strict=True
        ):
            left = table.whiten(table.tame(raw, 0), 0)[0, : data.residuals]
            cells += data.cells(left)
        return tuple(cells)


def misfits(likelihood: Likelihood, z: Tensor) -> Tensor:
    """Sums of squared residuals (N,) at many unknowns z (N, d), without their priors."""
    return -2.0 * likelihood.log_density(likelihood.prior.steps.values(z))


def error_left(likelihood: Likelihood, fitted: Fit) -> float:
    """Root mean square of what the factors of a fit leave as if noise were coarse, in ln|H|."""
    rough = coarse(likelihood).with_effects(fitted.placed)
    return COARSE_NOISE * float(rough.raw(fitted.parameters).square().mean().sqrt())


def fit(
    likelihood: Likelihood,
    placed: tuple[Placed, ...],
    start: Tensor,
    iterations: int = STEPS,
    steps: LogSteps | None = None,
    near: Tensor | None = None,
    renewed: bool = True,
) -> Fit:
    """Fit a model with effects from a starting point z (d,).

    Between the first step and the last the Jacobian is mended by what every step has shown.

    Args:
        likelihood: of the data, with the row of the table of errors that is taken for true.
        steps: the unknowns with their priors; by default those of the likelihood's prior.
        near: Jacobian (m, k) by the first unknowns at a point near the start, if known.
        renewed: whether that is made anew where no step helps, and at the end.
    """
    how = replace(_SEARCH, iterations=iterations, renewed=renewed)
    return _searched(likelihood, placed, start[None], how, steps, near)[0]


def _searched(
    likelihood: Likelihood,
    placed: tuple[Placed, ...],
    starts: Tensor,
    how: Search,
    steps: LogSteps | None = None,
    near: Tensor | None = None,
) -> list[Fit]:
    """A fit from every start (s, d)."""
    of = likelihood.with_effects(placed)
    target = _Target(of, steps or of.prior.steps)
    end = maximise(target, starts, how, near)
    ends = zip(end.z, end.residual, end.jacobian, end.raw, strict=True)
    return [Fit(of, target.steps, *parts) for parts in ends]


def glance(without: Fit, placed: Placed, starts: Sequence[Floats], steps: int) -> Fit:
    """Some steps of fits with one effect more, by the Jacobian of the model without it; the best.

    A fit's own Jacobian costs one response an unknown, at every step. Here only the effect's part
    is made anew; the rest is mended by what every step has shown.
    """
    of, together = without.likelihood, (*without.placed, placed)
    known = [np.concatenate([without.known, start]) for start in starts]
    tolerance = tolerance_of(placed, without.placed)
    if tolerance is not None:  # passes on what it is lessened by: no other way leaves the valley
        at = sum(len(other.effect.parameters) for other in without.placed[:tolerance])
        for values, start in zip(known, starts, strict=True):
            values[at] -= start[0] - placed.effect.parameters[0].neutral
    z = torch.stack([extended(of, without, together, values) for values in known])
    how = replace(_SEARCH, iterations=steps, renewed=False, fresh=len(without.z))
    fits = _searched(of, together, z, how, near=without.jacobian)
    return min(fits, key=lambda fitted: fitted.misfit)


def nearest(likelihood: Likelihood, base: Fit, placed: Placed, starts: Sequence[Floats]) -> Floats:
    """Which parameters (q,) of an effect more leave least, all else as it was fitted."""
    all_ = (*base.placed, placed)
    z = [extended(likelihood, base, all_, np.concatenate([base.known, s])) for s in starts]
    left = misfits(likelihood.with_effects(all_), torch.stack(z)).nan_to_num(nan=torch.inf)
    return starts[int(left.argmin())]


def about(likelihood: Likelihood, fitted: Fit) -> Likelihood:
    """The likelihood beside the errors that are known beforehand as they are about a fit."""
    there = likelihood.with_effects(fitted.placed).about(fitted.parameters)
    return replace(likelihood, error=there.error)


def settle(likelihood: Likelihood, fitted: Fit, iterations: int = STEPS) -> Fit:
    """The fit by the likeliest row of the table of errors at it, followed until it stays."""
    same = fitted.likelihood.reduced is likelihood.reduced
    of = likelihood.of(fitted.likelihood) if same else likelihood
    for _ in range(4):
        row = likeliest_row(likelihood, fitted)
        if fitted.likelihood.row == row and fitted.likelihood.error is likelihood.error:
            break
        fitted = fit(of.at_row(row), fitted.placed, fitted.z, iterations, fitted.steps)
    return fitted


def narrowed(fitted: Fit) -> Fit:
    """The fit, of a table of errors without rows that no model with an effect more would take.

    What explains more leaves errors no larger, or such as count already.
    """
    error, row = fitted.likelihood.error, fitted.likelihood.row
    counting = error.counting_beside(row, [kind[None] for kind in fitted.densities])
    rows = tuple(
        tuple(sorted({*count, *smaller, 0}))
        for count, smaller in zip(counting, error.no_larger(row), strict=True)
    )
    return replace(fitted, likelihood=fitted.likelihood.kept(rows))


def likeliest_row(likelihood: Likelihood, fitted: Fit) -> Row:
    """Row of every table of errors that residuals make most likely."""
    return tuple(int(kind.argmax()) for kind in densities(likelihood, fitted))


def densities(likelihood: Likelihood, fitted: Fit) -> tuple[Tensor, ...]:
    """(g,) log density of every kind of data at a fit by every row of its table of errors."""
    if fitted.likelihood.error is likelihood.error:
        return fitted.densities
    return _log_densities(likelihood, fitted.raw)


def _log_densities(likelihood: Likelihood, raw: Tensor) -> tuple[Tensor, ...]:
    """Minus infinity where no structure is left."""
    kinds = likelihood.error.log_densities(raw[None])
    return tuple(kind[0].nan_to_num(nan=-torch.inf) for kind in kinds)


def fit_baseline(
    likelihood: Likelihood,
    placed: tuple[Placed, ...] = (),
    sizes: tuple[float, ...] = (),
    seed: int = 0,
    samples: int = 384,
    starts: int = 8,
) -> list[Fit]:
    """Fit a model from the best of many draws of its prior, best first.

    Where much is left, either the model lacks something or the search ended beside the highest
    maximum. Further draws tell: it goes on until two searches end at the same place. (Of 48
    searches of sticks under earthquakes one ended beside it, 2 of 5 at worst; now none.)

    Args:
        likelihood: of the data by a model without effects.
        placed: effects that the model has already.
        sizes: their parameters, where the search starts.
        samples: draws of stiffness factors and damping ratio.
        starts: how many of them are fitted.
    """
    of = likelihood.with_effects(placed)
    known, rough = of.prior.steps.sizes(sizes), coarse(of).with_effects(placed)

    def best_first(fits: list[Fit]) -> list[Fit]:
        return sorted(fits, key=lambda fitted: -log_posterior(likelihood, fitted))

    def settled(near: Fit, row: Row = of.error.start) -> Fit:
        return settle(of, fit(of.at_row(row), placed, near.z, FAR_STEPS), FAR_STEPS)

    def searched(stream: Seed) -> list[Fit]:
        # Far from the data every point is many times the noise off, whichever way is better: first
        # they are compared as if they were coarse.
        z = prior_draws(of, known, samples, stream)
        best = z[misfits(rough, z).argsort()[:starts]]
        near = _searched(rough, placed, best, replace(_SEARCH, iterations=10))
        near.sort(key=lambda fitted: fitted.misfit)
        fits = best_first(in_threads(settled, near[: max(2, starts // 3)]))
        # A fit and its row hold each other; the largest errors let go what smaller ones hold.
        return best_first([*fits, *(settled(fits[0], row) for row in of.error.largest)])

    fits = searched(seed)
    for stream in spawn(seed, 3):
        if error_left(likelihood, fits[0]) < RIGHT:
            break
        best, further = log_posterior(likelihood, fits[0]), searched(stream)
        fits = best_first([*fits, *further])
        if abs(log_posterior(likelihood, further[0]) - best) < 1.0:  # nat: the same maximum
            break
    return fits


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
    return likelihood.on_fewer(FEWER_SHAPES).coarse(COARSE_NOISE)


def extended(
    likelihood: Likelihood, base: Fit, placed: tuple[Placed, ...], sizes: Sequence[float] | Floats
) -> Tensor:
    """Unknowns of a model with effects: those of the base fit, with given effect parameters."""
    known = likelihood.with_effects(placed).prior.steps.sizes(sizes)
    return torch.cat([base.z[: base.steps.first_size], known])


def with_more(fitted: Fit, placed: Placed, size: Floats) -> Fit:
    """A fit with one effect more, from the parameters (q,) of that, settled."""
    of, together = fitted.likelihood, (*fitted.placed, placed)
    start = extended(of, fitted, together, np.concatenate([fitted.known, size]))
    return settle(of, fit(of, together, start))


def with_last(fitted: Fit, number: int) -> Fit:
    """The same fit with one of its effects behind the others."""
    order = list(range(len(fitted.placed)))
    order.append(order.pop(number))
    if order == sorted(order):
        return fitted
    of, placed = fitted.likelihood, tuple(fitted.placed[k] for k in order)
    known = np.concatenate([fitted.known_of(k) for k in order])
    return fit(of, placed, extended(of, fitted, placed, known), 0)


def likelihood_about(fitted: Fit) -> Likelihood:
    """The likelihood of a fitted model's parameters, by the rows that count at the fit."""
    of = fitted.likelihood
    # The tables by which a hundred fits are compared are too coarse for intervals.
    error = of.error.finer(likeliest_row(of, fitted))
    values = error.log_densities(fitted.raw[None])
    likeliest = tuple(int(kind.argmax()) for kind in values)
    rows = error.counting_beside(likeliest, values)
    prior = of.prior.of("stiffness") + effect_parameters(fitted.placed) + of.prior.of("damping")
    return replace(of, error=error, prior=prior).at_row(likeliest).kept(rows)


def parameters_at(fitted: Fit) -> Tensor:
    """Parameters (1, p) of a fit, the damping ratio last."""
    theta, zeta, sizes = fitted.split
    return torch.cat([theta, sizes, zeta[:, None]], dim=1)
