"""Posteriors of dozens of parameters: populations that Hamiltonian moves carry from the prior.

In dozens of dimensions the posterior of stiffness factors is a thin curved sheet of several parts:
what the data determine well bends along what they leave open. Its highest maxima say little of
where its mass is, and chains that start there stay in their neighbourhood and agree with each
other on it. A population that comes from the prior, with the likelihood raised to growing powers
(Neal 2001, Statistics and Computing 11, 125; Del Moral, Doucet & Jasra 2006, J. R. Statist. Soc. B
68, 411), reaches all parts by their masses. It moves by trajectories of Hamiltonian dynamics (Neal
2011, Handbook of Markov Chain Monte Carlo, ch. 5), which follow the bends.

Several groups share steps and metric but no particles: whether they agree tells how well the
posterior is known.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.inference.tempering import next_increment, systematic_rows

# First step, in the units of the metric.
_FIRST_STEP = 0.3
# Standard normal coordinates beyond which a parameter is at its bound.
_EDGE = 8.0
# Draws from the diagonal that count beside the particles in a covariance.
_DIAGONAL = 5.0
_MOST_LEVELS = 200

Told = Callable[[float], None]
"""Hears of progress: the power of the likelihood, or the share of the draws, that is reached."""


@dataclass(frozen=True)
class AnnealedSettings:
    """How a population moves.

    Attributes:
        groups: that share no particles.
        particles: of each group.
        share: of a group's particles that stay effective from one power to the next, at least.
        moves: trajectories at each power.
        length: mean length of a trajectory in the units of the metric.
        acceptance: aimed at.
        most_steps: of a trajectory.
        rows: likelihoods whose derivatives are taken at a time.
        settle: trajectories at the whole likelihood before draws are kept, in which the step comes
            to rest.
    """

    groups: int = 4
    particles: int = 32
    share: float = 0.5
    moves: int = 3
    length: float = 1.5
    acceptance: float = 0.75
    most_steps: int = 20
    rows: int = 128
    settle: int = 6


def in_groups(groups: int, rows: int = AnnealedSettings.rows) -> AnnealedSettings:
    """The usual number of particles, in so many groups; not fewer than eight in one."""
    usual = AnnealedSettings()
    each = max(usual.groups * usual.particles // groups, 8)
    return AnnealedSettings(groups=groups, particles=each, rows=rows)


@dataclass(frozen=True)
class Population:
    """Equally weighted particles of every group.

    Attributes:
        xi: (g n, p) in the prior's standard normal coordinates, one group after the other.
        log_likelihood: (g n,) that they are drawn with.
        slope: (g n, p) of the log likelihood by xi.
        log_evidence: (g,) of the likelihood, by each group.
        step: of the trajectories, that the next population begins with.
        gradients: of log likelihoods taken so far.
        levels: powers passed so far.
    """

    xi: Tensor
    log_likelihood: Tensor
    slope: Tensor
    log_evidence: Tensor
    step: float
    gradients: int
    levels: int


@dataclass(frozen=True)
class AnnealedDraws:
    """States of a population at the whole likelihood.

    Attributes:
        theta: (g, m, p).
        log_likelihood: (g, m).
        log_evidence: (g,).
        acceptance: mean over the kept states.
        gradients: of log likelihoods taken in all.
        population: at the last state.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: Tensor
    acceptance: float
    gradients: int
    population: Population


def annealed(
    prior: UniformPrior,
    target: LogLikelihood,
    seed: int,
    settings: AnnealedSettings | None = None,
    *,
    start: Population | None = None,
    base: LogLikelihood | None = None,
    told: Told | None = None,
) -> Population:
    """Carry a population to prior times target.

    Args:
        prior: of the parameters.
        target: log likelihood, differentiable by torch.
        seed: of everything random.
        settings: see `AnnealedSettings`.
        start: drawn from prior times `base`; from the prior where there is none.
        base: log likelihood that the start was drawn with.
        told: see `Told`.

    Raises:
        InferenceError: no particle has a finite likelihood, or too many levels.
    """
    walk = _Walk(prior, target, base, settings or AnnealedSettings(), seed)
    state = walk.start(start)
    while state.beta < 1.0:
        walk.check_levels(state.beta)
        state = walk.moved(walk.raised(state))
        if told is not None:
            told(state.beta)
    return walk.population(state, start)


def annealed_draws(
    prior: UniformPrior,
    target: LogLikelihood,
    start: Population,
    draws: int,
    seed: int,
    settings: AnnealedSettings | None = None,
    told: Told | None = None,
) -> AnnealedDraws:
    """Draw at least so many states, of all groups together, from prior times target.

    Args:
        prior: of the parameters.
        target: log likelihood that the start is drawn with.
        start: population there.
        draws: to keep in all; every particle gives as many.
        seed: of everything random.
        settings: see `AnnealedSettings`.
        told: see `Told`.
    """
    chosen = settings or AnnealedSettings()
    walk = _Walk(prior, target, None, chosen, seed)
    state = walk.settled(walk.at_target(start))
    factor, kept, shares = _metric(state.xi, state.target_slope - state.xi), [], []
    turns = -(-draws // len(start.xi))
    for turn in range(turns):
        state, share = walk.trajectory(state, factor)
        kept.append(state)
        shares.append(share)
        if told is not None:
            told((turn + 1) / turns)

    return AnnealedDraws(
        _grouped([walk.theta(one.xi) for one in kept], chosen.groups),
        _grouped([one.target for one in kept], chosen.groups),
        start.log_evidence,
        sum(shares) / len(shares),
        start.gradients + walk.gradients,
        walk.population(state, start),
    )


@dataclass(frozen=True)
class CorrectedDraws:
    """Draws of a dear likelihood whose trajectories a cheap one has found.

    Attributes:
        theta: (g, m, p).
        log_likelihood: (g, m), dear.
        acceptance: mean over the kept states, of both likelihoods.
        gradients: of the cheap log likelihood taken in all.
        dear: dear likelihoods taken.
    """

    theta: Tensor
    log_likelihood: Tensor
    acceptance: float
    gradients: int
    dear: int


def corrected_draws(
    prior: UniformPrior,
    cheap: LogLikelihood,
    dear: LogLikelihood,
    start: Population,
    draws: int,
    seed: int,
    settings: AnnealedSettings | None = None,
    told: Told | None = None,
) -> CorrectedDraws:
    """Draw at least so many states from prior times a dear likelihood that a cheap one resembles.

    Trajectories follow the cheap likelihood, and where they end the dear one is asked (delayed
    acceptance, Christen & Fox 2005, J. Comput. Graph. Stat. 14, 795): the draws are the dear
    likelihood's, at one of it a move and none of its slopes.

    Args:
        prior: of the parameters.
        cheap: log likelihood that the start is drawn with, differentiable by torch.
        dear: log likelihood.
        start: population.
        draws: to keep in all; every particle gives as many.
        seed: of everything random.
        settings: see `AnnealedSettings`.
        told: see `Told`.
    """
    chosen = settings or AnnealedSettings()
    walk = _Walk(prior, cheap, None, chosen, seed)
    judge = _Judge(walk, dear, start)
    while judge.beta < 1.0:
        walk.check_levels(judge.beta)
        judge.raise_power()
        for _ in range(chosen.moves):
            judge.move()
    for _ in range(chosen.settle):
        judge.move()
    kept, shares = [], []
    turns = -(-draws // len(start.xi))
    for turn in range(turns):
        shares.append(judge.move())
        kept.append((walk.theta(judge.state.xi), judge.state.target + judge.gain))
        if told is not None:
            told((turn + 1) / turns)
    return CorrectedDraws(
        _grouped([theta for theta, _ in kept], chosen.groups),
        _grouped([value for _, value in kept], chosen.groups),
        sum(shares) / len(shares),
        start.gradients + walk.gradients,
        judge.asked,
    )


def _grouped(parts: list[Tensor], groups: int) -> Tensor:
    """(g, turns n, ...) of one (g n, ...) a turn."""
    return torch.cat([part.unflatten(0, (groups, -1)) for part in parts], dim=1)


@dataclass(frozen=True)
class _State:
    """Particles (n, p), their log likelihoods (n,) and slopes (n, p) under base and target, the
    power beta of the target against the base, and log evidence (g,) over the base's."""

    xi: Tensor
    base: Tensor
    base_slope: Tensor
    target: Tensor
    target_slope: Tensor
    beta: float
    log_evidence: Tensor

    def rows(self, rows: Tensor) -> "_State":
        """Some of the particles."""
        return replace(
            self,
            xi=self.xi[rows],
            base=self.base[rows],
            base_slope=self.base_slope[rows],
            target=self.target[rows],
            target_slope=self.target_slope[rows],
        )

    def where(self, take: Tensor, other: "_State") -> "_State":
        """Rows of `other` where `take` (n,), own rows elsewhere."""
        rows = take[:, None]
        return replace(
            self,
            xi=torch.where(rows, other.xi, self.xi),
            base=torch.where(take, other.base, self.base),
            base_slope=torch.where(rows, other.base_slope, self.base_slope),
            target=torch.where(take, other.target, self.target),
            target_slope=torch.where(rows, other.target_slope, self.target_slope),
        )

    def log_density(self) -> Tensor:
        """(n,), minus infinity where a likelihood is none."""
        value = self.beta * self.target - 0.5 * self.xi.square().sum(1)
        if self.beta < 1.0:
            value = value + (1.0 - self.beta) * self.base
        return torch.nan_to_num(value, nan=-torch.inf, posinf=-torch.inf, neginf=-torch.inf)

    def slope(self) -> Tensor:
        """(n, p) of the log density."""
        return (1.0 - self.beta) * self.base_slope + self.beta * self.target_slope - self.xi


@dataclass(frozen=True)
class _Resampled:
    """Step of the power, rows (n,) of the particles, log mean weight (g,) of the groups."""

    increment: float
    rows: Tensor
    log_mean: Tensor


class _Walk:
    """Moves populations from a base to a target; keeps the step and counts gradients."""

    def __init__(
        self,
        prior: UniformPrior,
        target: LogLikelihood,
        base: LogLikelihood | None,
        settings: AnnealedSettings,
        seed: int,
    ) -> None:
        self._prior, self._target, self._base = prior, target, base
        self.settings = settings
        self._generator = torch.Generator(device=prior.lower.device).manual_seed(seed)
        self._step = _FIRST_STEP
        self.gradients = self.levels = 0

    def start(self, population: Population | None) -> _State:
        """At the base, with power zero."""
        count = self.settings.groups * self.settings.particles
        xi = self._normal(count, self._prior.size) if population is None else population.xi
        self._step = self._step if population is None else population.step
        state = self._at(xi, 0.0, xi.new_zeros(self.settings.groups))
        finite = torch.isfinite(state.target - state.base).unflatten(0, (self.settings.groups, -1))
        if not bool(finite.any(dim=1).all()):
            raise InferenceError(
                f"none of {finite.shape[1]} parameter sets has a finite likelihood for this "
                "observation; check that the file and the building belong together"
            )
        return state

    def at_target(self, population: Population) -> _State:
        """A population that the target has drawn, with power one."""
        self._step = population.step
        zero = torch.zeros_like(population.log_likelihood)
        slopes = (torch.zeros_like(population.slope), population.log_likelihood, population.slope)
        return _State(population.xi, zero, *slopes, 1.0, torch.zeros_like(population.log_evidence))

    def population(self, state: _State, start: Population | None) -> Population:
        """What the target has drawn."""
        evidence, before, levels = state.log_evidence, 0, self.levels
        if start is not None:
            evidence = evidence + start.log_evidence
            before, levels = start.gradients, levels + start.levels
        return Population(
            state.xi,
            state.target,
            state.target_slope,
            evidence,
            self._step,
            before + self.gradients,
            levels,
        )

    def check_levels(self, beta: float) -> None:
        """Give up where the power does not grow."""
        if self.levels >= _MOST_LEVELS:
            raise InferenceError(
                f"the likelihood was raised to the power {beta:.3g} only, in {_MOST_LEVELS} "
                "steps; check that the observation and the building belong together"
            )

    def theta(self, xi: Tensor) -> Tensor:
        """Parameters (n, p)."""
        return self._prior.from_normal(xi.clamp(-_EDGE, _EDGE))

    def raised(self, state: _State) -> _State:
        """The next power, and every group resampled by what its particles gain."""
        found = self.resampled(state.target - state.base, 1.0 - state.beta)
        return replace(
            state.rows(found.rows),
            beta=min(state.beta + found.increment, 1.0),
            log_evidence=state.log_evidence + found.log_mean,
        )

    def resampled(self, gain: Tensor, most: float) -> "_Resampled":
        """By what particles (n,) gain per unit of the power, of which `most` is left."""
        finite = torch.where(torch.isfinite(gain), gain, -torch.inf)
        grouped = finite.unflatten(0, (self.settings.groups, -1))
        increment = min(next_increment(one, most, self.settings.share) for one in grouped)
        log_weight, each = increment * grouped, grouped.shape[1]
        rows = [
            k * each + systematic_rows(torch.softmax(weight, 0), self._generator)
            for k, weight in enumerate(log_weight)
        ]
        self.levels += 1
        log_mean = torch.logsumexp(log_weight, 1) - math.log(each)
        return _Resampled(increment, torch.cat(rows), log_mean)

    def moved(self, state: _State) -> _State:
        """After the moves of a power."""
        for _ in range(self.settings.moves):
            state = self._adapted(state, 1.0)
        return state

    def settled(self, state: _State) -> _State:
        """After the moves that draws are not kept of: the step comes to rest."""
        for turn in range(self.settings.settle):
            state = self._adapted(state, 1.0 / (1.0 + turn))
        return state

    def _adapted(self, state: _State, gain: float) -> _State:
        """After a trajectory, and the step towards the acceptance that is aimed at."""
        state, share = self.trajectory(state, _metric(state.xi, state.slope()))
        self._step *= math.exp(gain * (share - self.settings.acceptance))
        return state

    def trajectory(self, state: _State, factor: Tensor) -> tuple[_State, float]:
        """One trajectory of every particle by the leapfrog rule; the mean acceptance.

        Args:
            state: of the particles.
            factor: (p, p) Cholesky factor of the metric.
        """
        # Lengths that vary keep trajectories from closing on themselves, short steps now and then
        # get particles out of sharp bends.
        length = self.settings.length * float(0.5 + self.uniform(1))
        size = self._step * float(0.7 + 0.6 * self.uniform(1))
        steps = max(1, min(self.settings.most_steps, round(length / size)))
        velocity = self._normal(*state.xi.shape)
        energy = state.log_density() - 0.5 * velocity.square().sum(1)
        end = state
        for _ in range(steps):
            velocity = velocity + 0.5 * size * (end.slope() @ factor)
            end = self._at(end.xi + size * velocity @ factor.T, end.beta, end.log_evidence)
            velocity = velocity + 0.5 * size * (end.slope() @ factor)
        gain = end.log_density() - 0.5 * velocity.square().sum(1) - energy
        chance = torch.nan_to_num(gain, nan=-torch.inf).clamp_max(0.0).exp()
        return state.where(self.uniform(len(chance)) < chance, end), float(chance.mean())

    def _at(self, xi: Tensor, beta: float, log_evidence: Tensor) -> _State:
        zero = torch.zeros_like(xi)
        base = (zero[:, 0], zero)
        # The base is out of the game at the last power.
        if self._base is not None and beta < 1.0:
            base = self._asked(self._base, xi)
        return _State(xi, *base, *self._asked(self._target, xi), beta, log_evidence)

    def _asked(self, log_likelihood: LogLikelihood, xi: Tensor) -> tuple[Tensor, Tensor]:
        """Values (n,), and slopes (n, p) that are zero where there are none."""
        self.gradients += len(xi)
        parts = []
        for rows in xi.clamp(-_EDGE, _EDGE).split(self.settings.rows):
            free = rows.detach().requires_grad_()
            value = log_likelihood(self._prior.from_normal(free)).to(torch.float64)
            (slope,) = torch.autograd.grad(value.sum(), free)
            parts.append((value.detach(), slope))
        value, slope = (torch.cat(each) for each in zip(*parts, strict=True))
        finite = torch.isfinite(value) & torch.isfinite(slope).all(dim=1)
        return torch.where(finite, value, -torch.inf), torch.where(finite[:, None], slope, 0.0)

    def uniform(self, count: int) -> Tensor:
        """(count,) of the walk's own random numbers."""
        kind = self._prior.lower
        return torch.rand(count, generator=self._generator, dtype=kind.dtype, device=kind.device)

    def _normal(self, *shape: int) -> Tensor:
        kind = self._prior.lower
        return torch.randn(*shape, generator=self._generator, dtype=kind.dtype, device=kind.device)


class _Judge:
    """A population that moves along the cheap likelihood and is judged by the dear one.

    Attributes:
        state: of the cheap likelihood.
        gain: (n,) dear less cheap log likelihood.
        beta: power that the gain is raised to.
        asked: dear likelihoods.
    """

    def __init__(self, walk: _Walk, dear: LogLikelihood, start: Population) -> None:
        self._walk, self._dear = walk, dear
        self.state, self.beta, self.asked = walk.at_target(start), 0.0, 0
        self._factor = _metric(self.state.xi, self.state.slope())
        self.gain = self._asked(self.state)

    def raise_power(self) -> None:
        """Go on to the next power."""
        found = self._walk.resampled(self.gain, 1.0 - self.beta)
        self.state, self.gain = self.state.rows(found.rows), self.gain[found.rows]
        self.beta = min(self.beta + found.increment, 1.0)

    def move(self) -> float:
        """One trajectory of every particle; the share that is accepted by both likelihoods."""
        tried, _ = self._walk.trajectory(self.state, self._factor)
        moved = (tried.xi != self.state.xi).any(dim=1)
        gain = self.gain.clone()
        gain[moved] = self._asked(tried.rows(moved.nonzero()[:, 0]))
        chance = (self.beta * (gain - self.gain)).clamp_max(0.0).exp()
        take = moved & (self._walk.uniform(len(chance)) < chance)
        self.state, self.gain = self.state.where(take, tried), torch.where(take, gain, self.gain)
        return float(take.double().mean())

    def _asked(self, state: _State) -> Tensor:
        self.asked += len(state.xi)
        gain = self._dear(self._walk.theta(state.xi)).to(torch.float64) - state.target
        return torch.nan_to_num(gain, nan=-torch.inf, posinf=-torch.inf, neginf=-torch.inf)


def _metric(xi: Tensor, slope: Tensor) -> Tensor:
    """Cholesky factor (p, p) of the metric in which particles and slopes have one covariance.

    It is the geometric mean of the covariance of the particles and the inverse of that of the
    slopes of the log density: the first tells how far the sheet reaches, the second how thin it
    is; the two agree for a Gaussian.
    """
    wide, steep = _covariance(xi - xi.mean(0)), _covariance(slope)
    root, inverse = _power(wide, 0.5), _power(wide, -0.5)
    mean = root @ _power(inverse @ torch.linalg.inv(steep) @ inverse, 0.5) @ root
    return torch.linalg.cholesky(0.5 * (mean + mean.T))


def _covariance(rows: Tensor) -> Tensor:
    """(p, p) about zero of rows (n, p), drawn towards its diagonal where rows are few."""
    found = rows.T @ rows / len(rows)
    found = found + 1e-10 * found.diagonal().mean() * torch.eye(len(found)).to(found)
    share = _DIAGONAL / (len(rows) + _DIAGONAL)
    return (1.0 - share) * found + share * torch.diag(found.diagonal())


def _power(matrix: Tensor, power: float) -> Tensor:
    """Of a symmetric positive matrix (p, p)."""
    values, vectors = torch.linalg.eigh(matrix)
    return (vectors * values.clamp_min(1e-30) ** power) @ vectors.T
