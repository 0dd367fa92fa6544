"""The highest points of a posterior, from many starts at once, by Levenberg and Marquardt's method.

Lessened is |r|^2 + (z - m)' P (z - m) for whitened residuals r of unknowns z within limits
(Marquardt 1963, J. SIAM 11, 431). Between the first step and the last the Jacobian may be mended by
what every step has shown (Broyden 1965, Math. Comput. 19, 577).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor


@dataclass(frozen=True)
class LatentData:
    """An observation on all floors of the decoder.

    Attributes:
        log_frf: (f, k), all floors of the decoder; zero where the weight is zero.
        weight: (f, k) inverse variance of what is not explained; zero where nothing is observed.
    """

    log_frf: Tensor
    weight: Tensor


@dataclass(frozen=True)
class Descent:
    """Where the minimisation ended.

    Attributes:
        z: (s, z).
        nats: (s,) -ln p(x|z) p(z), up to a constant.
        information: (s, z, z) Gauss-Newton curvature of -ln p(x|z).
        pull: (s, z) gradient of ln p(x|z).
    """

    z: Tensor
    nats: Tensor
    information: Tensor
    pull: Tensor

    def __getitem__(self, rows: list[int]) -> "Descent":
        parts = (self.z, self.nats, self.information, self.pull)
        return Descent(*(part[rows] for part in parts))

    @property
    def precision(self) -> Tensor:
        """(s, z, z) of the posterior about each point, in double precision on the processor."""
        information = self.information.double()
        return information + torch.eye(information.shape[-1]).to(information)

    @property
    def log_mass(self) -> Tensor:
        """Log share (s,) of the posterior about each point, but for a constant (Laplace)."""
        return -self.nats.double() - 0.5 * torch.linalg.slogdet(self.precision)[1]


class Residuals:
    """Whitened residuals as a function of standard normal coordinates.

    Args:
        residuals: z (s, z) to residuals (s, m).
        step: of finite differences in z, or (z,) of each.
    """

    def __init__(self, residuals: Callable[[Tensor], Tensor], step: float | Tensor) -> None:
        self._residuals, self._step = residuals, step
        self.responses = 0

    def __call__(self, z: Tensor) -> Tensor:
        """Residuals (s, m) at z (s, z)."""
        self.responses += len(z)
        return self._residuals(z)

    def derivative(self, z: Tensor, residual: Tensor) -> Tensor:
        """Derivatives (s, m, z) of the response, whitened, where the residuals are `residual`.

        Finite differences go towards the middle of the prior: beyond the edge of the allowed
        range nothing may change.
        """
        size = z.shape[1]
        step = torch.where(z > 0.0, -1.0, 1.0) * self._step
        moved = self((z[:, None] + torch.diag_embed(step)).flatten(0, 1)).view(len(z), size, -1)
        return (residual[:, None] - moved).transpose(1, 2) / step[:, None]


def misfit_of(respond: Callable[[Tensor], Tensor], data: LatentData, step: float) -> Residuals:
    """That of a model z (n, z) to ln|H| (n, f, k), with a step of finite differences in z."""
    root = data.weight.sqrt()
    return Residuals(lambda z: (root * (data.log_frf - respond(z))).flatten(1), step)


@dataclass(frozen=True, eq=False)
class _InNormal:
    """Residuals of standard normal coordinates, which have no limits."""

    misfit: Residuals
    lower: Tensor
    upper: Tensor
    mean: Tensor
    precision: Tensor

    def raw(self, z: Tensor) -> Tensor:
        return self.misfit(z)

    def whitened(self, raw: Tensor) -> Tensor:
        return raw

    def with_derivative(self, z: Tensor, first: int) -> tuple[Tensor, Tensor, Tensor]:
        residual = self.misfit(z)
        return residual, residual, self.derivative(z, residual, first)

    def derivative(self, z: Tensor, residual: Tensor, first: int) -> Tensor:
        # Derivatives of 16 starts are held in memory at a time.
        parts = zip(z.split(16), residual.split(16), strict=True)
        return torch.cat([self.misfit.derivative(*both)[:, :, first:] for both in parts])


def descend(misfit: Residuals, starts: Tensor, how: "Search | None" = None) -> Descent:
    """Minimise the misfit from every start (s, z)."""
    size = starts.shape[1]
    far, scale = starts.new_full((size,), torch.inf), torch.eye(size).to(starts)
    found = maximise(
        _InNormal(misfit, -far, far, torch.zeros_like(far), scale),
        starts,
        how or Search(iterations=40, small_nats=1e-3),
    )
    jacobian, residual = found.jacobian, found.residual
    pull = (jacobian.mT @ residual[:, :, None])[:, :, 0]
    return Descent(found.z, 0.5 * found.objective, jacobian.mT @ jacobian, pull)


def nats_of(residual: Tensor, z: Tensor) -> Tensor:
    """-ln p(x|z) p(z) (s,), up to a constant, from residuals (s, m) at z (s, z)."""
    return 0.5 * (residual.square().sum(1) + z.square().sum(1))


def distinct(descent: Descent, log_mass: Tensor, *, nats: float, count: int) -> Descent:
    """Different end points that count, the heaviest (log masses (s,)) first.

    Two within a standard deviation of the posterior are one.

    Args:
        nats: that one may be lighter than the heaviest.
    """
    z, precision = descent.z.double(), descent.precision
    rows: list[int] = []
    for row in torch.argsort(log_mass, descending=True).tolist():
        if log_mass[row] < log_mass.max() - nats or len(rows) == count:
            break
        offsets = z[rows] - z[row]
        distance = torch.einsum("ci,cij,cj->c", offsets, precision[rows], offsets)
        if bool((distance > 1.0).all()):
            rows.append(row)
    return descent[rows]


_DAMPING, _LEAST_DAMPING = 1e-2, 1e-6  # of the curvature: at first, and at least


class LeastSquares(Protocol):
    """Squares of residuals and of the distance from normal priors, which are lessened.

    Attributes:
        lower, upper: (d,) limits.
        mean, precision: (d,) and (d, d) of the normal priors; 0 where a prior is uniform.
    """

    @property
    def lower(self) -> Tensor: ...
    @property
    def upper(self) -> Tensor: ...
    @property
    def mean(self) -> Tensor: ...
    @property
    def precision(self) -> Tensor: ...

    def raw(self, z: Tensor) -> Tensor:
        """Residuals (s, n) at unknowns z (s, d), observed less predicted."""

    def whitened(self, raw: Tensor) -> Tensor:
        """The same of unit covariance, (s, m)."""

    def derivative(self, z: Tensor, residual: Tensor, first: int) -> Tensor:
        """Change (s, m, d - first) of the whitened prediction by the unknowns from one on."""

    def with_derivative(self, z: Tensor, first: int) -> tuple[Tensor, Tensor, Tensor]:
        """Residuals, the same whitened, and their derivative, at once."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """How a search goes, and when it ends.

    Attributes:
        small: gain of a step, as a share of the objective, below which a start is finished.
        most_damping: beyond which a start is finished.
        longest: of a step, in any unknown.
        mended: whether Jacobians are mended by what steps show, and not made at each.
        renewed: whether a mended one is made anew far off, where no step helps, and at the end.
        fresh: first of the unknowns whose part of a mended one is made at every step.
    """

    iterations: int = 15
    small: float = 0.0
    small_nats: float = 0.0
    most_damping: float = 1e6
    longest: float = torch.inf
    mended: bool = False
    renewed: bool = True
    fresh: int | None = None


@dataclass(frozen=True, eq=False)
class Maxima:
    """Where s searches are, or have ended.

    Attributes:
        z: (s, d) unknowns.
        raw: (s, n) residuals there, and `residual` (s, m) whitened.
        jacobian: (s, m, d) of the whitened prediction.
        objective: (s,) squares with the distance from the priors' means.
    """

    z: Tensor
    raw: Tensor
    residual: Tensor
    jacobian: Tensor
    objective: Tensor

    def __getitem__(self, rows: Tensor) -> "Maxima":
        parts = (self.z, self.raw, self.residual, self.jacobian, self.objective)
        return Maxima(*(part[rows] for part in parts))

    def put(self, rows: Tensor, other: "Maxima") -> None:
        """Take the points of other searches in place of some; Jacobians stay."""
        self.z[rows], self.raw[rows], self.residual[rows] = other.z, other.raw, other.residual
        self.objective[rows] = other.objective


def maximise(
    problem: LeastSquares, starts: Tensor, how: Search, near: Tensor | None = None
) -> Maxima:
    """Search from every start (s, d).

    Args:
        starts: (s, d); those beyond a limit begin at it.
        near: (m, k) Jacobian by the first unknowns at points near the starts, if known.
    """
    begun = torch.minimum(torch.maximum(starts, problem.lower), problem.upper)
    now = _at(problem, begun, 0 if near is None else near.shape[1])
    if near is not None:
        jacobian = torch.cat([near.expand(len(now.z), -1, -1), now.jacobian], dim=2)
        now = replace(now, jacobian=jacobian)
    active = torch.ones(len(starts), dtype=torch.bool)
    mended, damping = (
        torch.full_like(active, near is not None),
        torch.full_like(now.objective, _DAMPING),
    )
    old = torch.zeros_like(active)  # whether a Jacobian is that of the point before

    def renew(rows: Tensor) -> None:
        if len(rows):
            now.jacobian[rows] = problem.derivative(now.z[rows], now.residual[rows], 0)

    for left in reversed(range(how.iterations)):
        rows = active.nonzero()[:, 0]
        if not len(rows):
            break
        tried, used = _tried(problem, now[rows], damping[rows], how)
        before = now.objective[rows]
        better = tried.objective < before
        # No step helps: a better Jacobian may, or shorter ones.
        stuck = rows[~better]
        again = stuck[mended[stuck]] if how.renewed else stuck[:0]
        renew(again)
        shorter = stuck[~mended[stuck]] if how.renewed else stuck
        damping[shorter] *= 1000.0
        active[shorter] = damping[shorter] <= how.most_damping
        gain, moved, reached = (
            (before - tried.objective)[better],
            rows[better],
            tried[better.nonzero()[:, 0]],
        )
        was = now[moved]
        now.put(moved, reached)
        damping[moved] = (used[better] / 10.0).clamp_min(_LEAST_DAMPING)
        share = gain / was.objective.clamp_min(1.0)
        small = (share < how.small) | (0.5 * gain < how.small_nats)
        done = small & ~mended[moved] if how.renewed else small | (left == 0)
        active[moved[done]], old[moved[done]] = False, True
        # Above .3 of the objective a step does not tell how the next one changes it. With .05 to 1
        # the six-story example takes 3,811 to 3,568 responses, and 5,088 with 0.
        anew = (small | (share > 0.3) | (not how.mended)) & ~done & how.renewed
        renew(moved[anew])
        follow = (~done & ~anew).nonzero()[:, 0]
        _mend(now, was[follow], moved[follow], reached[follow].jacobian)
        mended[again], mended[moved[anew]], mended[moved[follow]] = False, False, True
    if how.renewed:
        renew((mended | (old & (not how.mended))).nonzero()[:, 0])
    return now


def _at(problem: LeastSquares, z: Tensor, first: int | None) -> Maxima:
    """Searches at z (s, d), with their Jacobians by the unknowns from one on; None for none."""
    if first is None:
        raw, jacobian = problem.raw(z), z[:, None, :0]
        residual = problem.whitened(raw)
    else:
        raw, residual, jacobian = problem.with_derivative(z, first)
    away = z - problem.mean
    objective = residual.square().sum(1) + ((away @ problem.precision) * away).sum(1)
    return Maxima(z.clone(), raw, residual, jacobian, objective)


def _tried(
    problem: LeastSquares, now: Maxima, damping: Tensor, how: Search
) -> tuple[Maxima, Tensor]:
    """The best of steps of several lengths from every point, and their damping (s,)."""

    def stepped(points: Maxima, by: Tensor) -> Maxima:
        step = _steps(problem, points, by).clamp(-how.longest, how.longest)
        trial = torch.minimum(torch.maximum(points.z + step, problem.lower), problem.upper)
        found = _at(problem, trial, how.fresh)
        return replace(found, objective=found.objective.nan_to_num(nan=torch.inf))

    found, used = stepped(now, damping), damping.clone()
    failed = (~(found.objective < now.objective)).nonzero()[:, 0]
    if len(failed):
        twice = torch.cat([failed, failed])
        by = torch.cat([10.0 * damping[failed], 100.0 * damping[failed]])
        both = stepped(now[twice], by)
        which = both.objective.view(2, -1).argmin(0) * len(failed)
        chosen = which + torch.arange(len(failed))
        found.put(failed, both[chosen])
        found.jacobian[failed] = both.jacobian[chosen]
        used[failed] = by[chosen]
    return found, used


def _steps(problem: LeastSquares, now: Maxima, damping: Tensor) -> Tensor:
    """Damped Gauss-Newton steps (s, d) that leave alone what is held at its limit."""
    z, jacobian, precision = now.z, now.jacobian, problem.precision
    gradient = (jacobian.mT @ now.residual[:, :, None])[:, :, 0] - (z - problem.mean) @ precision
    held = ((z <= problem.lower) & (gradient < 0)) | ((z >= problem.upper) & (gradient > 0))
    normal = jacobian.mT @ jacobian + precision
    normal = normal * ~(held[:, :, None] | held[:, None, :])
    diagonal = torch.where(
        held, 1.0, damping[:, None] * normal.diagonal(dim1=1, dim2=2).clamp_min(1e-6)
    )
    whole = (normal + torch.diag_embed(diagonal)).double()
    right = torch.where(held, 0.0, gradient).double()
    step = torch.linalg.solve_ex(whole, right[:, :, None])[0][:, :, 0]
    # Where the response is no number, a search stays where it is.
    return step.nan_to_num(0.0, 0.0, 0.0).to(z)


def _mend(now: Maxima, before: Maxima, rows: Tensor, fresh: Tensor) -> None:
    """Mend some Jacobians by what the steps from the points before have shown.

    The last columns are those (s, m, f) that were made anew, if any.
    """
    if not len(rows):
        return
    moved = now.z[rows] - before.z
    missed = before.residual - now.residual[rows] - (before.jacobian @ moved[:, :, None])[:, :, 0]
    scaled = moved / moved.square().sum(1, keepdim=True)
    jacobian = before.jacobian + missed[:, :, None] * scaled[:, None, :]
    jacobian[:, :, jacobian.shape[2] - fresh.shape[2] :] = fresh
    now.jacobian[rows] = jacobian
