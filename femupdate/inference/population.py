"""Particles that move by trajectories of Hamiltonian dynamics between two likelihoods.

Leapfrog trajectories (Neal 2011, Handbook of Markov Chain Monte Carlo, ch. 5) in the prior's
standard normal coordinates. Groups of particles share steps and metric, and are resampled apart.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.inference.tempering import next_increment, systematic_rows
from femupdate.seeds import Seed, torch_generator

# First step, in the units of the metric.
_FIRST_STEP = 0.3
# Standard normal coordinates beyond which a parameter is at its bound.
_EDGE = 8.0
# Draws from the diagonal that count beside the particles in a covariance.
_DIAGONAL = 5.0
_MOST_LEVELS = 200


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
class State:
    """Particles (n, p), their log likelihoods (n,) and slopes (n, p) under base and target, the
    power beta of the target against the base, and log evidence (g,) over the base's."""

    xi: Tensor
    base: Tensor
    base_slope: Tensor
    target: Tensor
    target_slope: Tensor
    beta: float
    log_evidence: Tensor

    def rows(self, rows: Tensor) -> "State":
        """Some of the particles."""
        return replace(
            self,
            xi=self.xi[rows],
            base=self.base[rows],
            base_slope=self.base_slope[rows],
            target=self.target[rows],
            target_slope=self.target_slope[rows],
        )

    def where(self, take: Tensor, other: "State") -> "State":
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
class Resampled:
    """Step of the power, rows (n,) of the particles, log mean weight (g,) of the groups."""

    increment: float
    rows: Tensor
    log_mean: Tensor


class Walk:
    """Moves populations from a base to a target; keeps the step and counts gradients."""

    def __init__(
        self,
        prior: UniformPrior,
        target: LogLikelihood,
        base: LogLikelihood | None,
        settings: AnnealedSettings,
        seed: Seed,
    ) -> None:
        self._prior, self._target, self._base = prior, target, base
        self.settings = settings
        self._generator = torch_generator(seed, prior.lower.device)
        self._step = _FIRST_STEP
        self.gradients = self.levels = 0

    def start(self, population: Population | None) -> State:
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

    def at_target(self, population: Population) -> State:
        """A population that the target has drawn, with power one."""
        self._step = population.step
        zero = torch.zeros_like(population.log_likelihood)
        slopes = (torch.zeros_like(population.slope), population.log_likelihood, population.slope)
        return State(population.xi, zero, *slopes, 1.0, torch.zeros_like(population.log_evidence))

    def population(self, state: State, start: Population | None) -> Population:
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

    def raised(self, state: State) -> State:
        """The next power, and every group resampled by what its particles gain."""
        found = self.resampled(state.target - state.base, 1.0 - state.beta)
        return replace(
            state.rows(found.rows),
            beta=min(state.beta + found.increment, 1.0),
            log_evidence=state.log_evidence + found.log_mean,
        )

    def resampled(self, gain: Tensor, most: float) -> "Resampled":
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
        return Resampled(increment, torch.cat(rows), log_mean)

    def moved(self, state: State) -> State:
        """After the moves of a power."""
        for _ in range(self.settings.moves):
            state = self._adapted(state, 1.0)
        return state

    def settled(self, state: State) -> State:
        """After the moves that draws are not kept of: the step comes to rest."""
        for turn in range(self.settings.settle):
            state = self._adapted(state, 1.0 / (1.0 + turn))
        return state

    def _adapted(self, state: State, gain: float) -> State:
        """After a trajectory, and the step towards the acceptance that is aimed at."""
        state, share = self.trajectory(state, metric(state.xi, state.slope()))
        self._step *= math.exp(gain * (share - self.settings.acceptance))
        return state

    def trajectory(self, state: State, factor: Tensor) -> tuple[State, float]:
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

    def _at(self, xi: Tensor, beta: float, log_evidence: Tensor) -> State:
        zero = torch.zeros_like(xi)
        base = (zero[:, 0], zero)
        # The base is out of the game at the last power.
        if self._base is not None and beta < 1.0:
            base = self._asked(self._base, xi)
        return State(xi, *base, *self._asked(self._target, xi), beta, log_evidence)

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


def metric(xi: Tensor, slope: Tensor) -> Tensor:
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


def grouped(parts: list[Tensor], groups: int) -> Tensor:
    """(g, turns n, ...) of one (g n, ...) a turn."""
    return torch.cat([part.unflatten(0, (groups, -1)) for part in parts], dim=1)
