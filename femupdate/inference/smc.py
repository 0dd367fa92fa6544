"""Tempered sequential Monte Carlo: particles from the prior, or a start, to the posterior.

A likelihood is raised to powers beta from 0 to 1 (Neal 2001, Statistics and Computing 11, 125; Del
Moral, Doucet & Jasra 2006, J. R. Statist. Soc. B 68, 411); from a start about the maxima, the ratio
of the posterior to it. Every level: next beta by the effective sample size, systematic resampling,
then Metropolis-Hastings moves of all particles in one batch. Particles in several groups share beta
and moves, but are resampled apart: whether the groups agree tells how well the posterior is known.
"""

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.importance import (
    EDGE,
    LogLikelihood,
    Mixture,
    SamplerRun,
    fit_mixture,
    next_increment,
    systematic_rows,
)
from femupdate.inference.parameters import Parameters
from femupdate.seeds import Seed, torch_generator


@dataclass(frozen=True)
class Points:
    """Particles in the prior's standard normal coordinates, and what is known of them.

    Attributes:
        xi: (n, d).
        log_likelihood: (n,), minus infinity where a particle is impossible.
        slope: (n, d) of it by xi; None where no move asks for it.
    """

    xi: Tensor
    log_likelihood: Tensor
    slope: Tensor | None = None

    def rows(self, rows: Tensor) -> "Points":
        """Some of the particles."""
        slope = None if self.slope is None else self.slope[rows]
        return Points(self.xi[rows], self.log_likelihood[rows], slope)

    def where(self, take: Tensor, other: "Points") -> "Points":
        """Particles of `other` where `take` (n,), these elsewhere."""
        slope = None
        if self.slope is not None and other.slope is not None:
            slope = torch.where(take[:, None], other.slope, self.slope)
        return Points(
            torch.where(take[:, None], other.xi, self.xi),
            torch.where(take, other.log_likelihood, self.log_likelihood),
            slope,
        )


class Tempered:
    """From a start to prior x likelihood, start^(1 - beta) x (prior x likelihood)^beta.

    Args:
        rows: likelihoods whose derivatives are taken at a time.
        start: density of standard normal coordinates; the prior where None.

    Attributes:
        evaluations: of the likelihood so far, one a particle and move.
        invalid: how many of them gave no finite number; all count as impossible.
    """

    def __init__(
        self, prior: Parameters, log_likelihood: LogLikelihood, rows: int, start: Mixture | None
    ) -> None:
        self.prior, self._log_likelihood, self._rows = prior, log_likelihood, rows
        zero = prior.lower.new_zeros(1, prior.size)
        self.start = start or Mixture(zero[:, 0], zero, torch.eye(prior.size).to(zero)[None])
        self.beta, self.evaluations, self.invalid = 0.0, 0, 0

    def parameters(self, xi: Tensor) -> Tensor:
        """(n, p) of coordinates (n, d)."""
        return self.prior.from_normal(xi.clamp(-EDGE, EDGE))

    def at(self, xi: Tensor, slopes: bool = False) -> Points:
        """Likelihoods at coordinates (n, d), and their slopes (zero where there is no number)."""
        self.evaluations += len(xi)
        if not slopes:
            value = self._log_likelihood(self.parameters(xi)).to(torch.float64)
            wrong = torch.isnan(value) | torch.isposinf(value)
            points = Points(xi, torch.where(wrong, -torch.inf, value))
        else:
            parts = []
            for some in xi.split(self._rows):
                free = some.clamp(-EDGE, EDGE).detach().requires_grad_()
                value = self._log_likelihood(self.prior.from_normal(free)).to(torch.float64)
                (slope,) = torch.autograd.grad(value.sum(), free)
                parts.append((value.detach(), slope))
            value, slope = (torch.cat(each) for each in zip(*parts, strict=True))
            finite = torch.isfinite(value) & torch.isfinite(slope).all(dim=1)
            value = torch.where(finite, value, -torch.inf)
            points = Points(xi, value, torch.where(finite[:, None], slope, 0.0))
        self.invalid += int(torch.isneginf(points.log_likelihood).sum())
        return points

    def gain(self, points: Points) -> Tensor:
        """Log ratio (n,) of prior x likelihood to the start."""
        prior = self.prior.log_density_normal(points.xi)
        return points.log_likelihood + prior - self.start.log_density(points.xi)

    def log_density(self, points: Points) -> Tensor:
        """(n,)."""
        return self.start.log_density(points.xi) + self.beta * self.gain(points)

    def slope(self, points: Points) -> Tensor:
        """(n, d) of the log density, for points with slopes."""
        assert points.slope is not None
        xi = points.xi.detach().requires_grad_()
        (start,) = torch.autograd.grad(self.start.log_density(xi).sum(), xi)
        return (1.0 - self.beta) * start + self.beta * (points.slope - points.xi)


class Move(Protocol):
    """Moves all particles so that the tempered density stays what it is."""

    @property
    def slopes(self) -> bool:
        """Whether it needs the derivatives of the log likelihood."""

    def fit(self, density: Tempered, points: Points, generator: torch.Generator) -> None:
        """Learn from the particles at the start of a level."""

    def step(
        self, density: Tempered, points: Points, generator: torch.Generator
    ) -> tuple[Points, float]:
        """Particles after one move of all, and the share of the moves accepted."""


class RandomWalk:
    """Steps of covariance b^2 S, S that of the particles (Ching & Chen 2007, J. Eng. Mech. 133)."""

    slopes = False

    def __init__(self, scale: float) -> None:
        self._scale = scale

    def fit(self, density: Tempered, points: Points, generator: torch.Generator) -> None:
        """Take the covariance of the particles, with a ridge for degenerate sets."""
        size = points.xi.shape[1]
        covariance = torch.cov(points.xi.T).reshape(size, size)
        ridge = 1e-10 * torch.eye(size).to(points.xi)
        self._factor = self._scale * torch.linalg.cholesky(covariance + ridge)

    def step(
        self, density: Tempered, points: Points, generator: torch.Generator
    ) -> tuple[Points, float]:
        """Particles after one step of all, and the share of the steps accepted."""
        trial = density.at(points.xi + normal_like(points.xi, generator) @ self._factor.T)
        return accepted(
            points, trial, density.log_density(trial) - density.log_density(points), generator
        )


class MixtureIndependence:
    """Draws from a mixture of Students fitted to the particles, whatever the particle was.

    Args:
        components: Students of the mixture, at most.
    """

    slopes = False

    def __init__(self, components: int) -> None:
        self._components = components

    def fit(self, density: Tempered, points: Points, generator: torch.Generator) -> None:
        """Fit the mixture, to five hundred particles a Student."""
        xi, some = points.xi, 500 * self._components
        # On a few different points a Student would propose those again and again.
        most = max(1, distinct_rows(xi) // (5 * (xi.shape[1] + 1)))
        if len(xi) > some:
            xi = xi[torch.randperm(len(xi), generator=generator)[:some]]
        fitted = fit_mixture(xi, min(self._components, most), generator)
        # Wider: particles lag behind where the likelihood moves on.
        self._mixture = fitted.widened(1.5, freedom=4)

    def step(
        self, density: Tempered, points: Points, generator: torch.Generator
    ) -> tuple[Points, float]:
        """Particles after one proposal for each, and the share accepted."""
        mixture: Mixture = self._mixture
        trial = density.at(mixture.sample(len(points.xi), generator))
        log_ratio = (
            density.log_density(trial)
            - density.log_density(points)
            + mixture.log_density(points.xi)
            - mixture.log_density(trial.xi)
        )
        return accepted(points, trial, log_ratio, generator)


class Hamiltonian:
    """Trajectories by the leapfrog rule, in the metric of particles and slopes.

    In dozens of dimensions the posterior of stiffness factors is a thin curved sheet of several
    parts: what the data determine well bends along what they leave open. Trajectories (Neal 2011,
    Handbook of Markov Chain Monte Carlo, ch. 5) follow the bends. Their step adapts.
    """

    slopes = True

    def __init__(self) -> None:
        self._size = 0.3

    def fit(self, density: Tempered, points: Points, generator: torch.Generator) -> None:
        """Take the Cholesky factor (d, d) of the metric."""
        self._factor = _metric(points.xi, density.slope(points))

    def step(
        self, density: Tempered, points: Points, generator: torch.Generator
    ) -> tuple[Points, float]:
        """Particles after one trajectory of each, and the share accepted; .75 is aimed at."""
        # Lengths that vary keep trajectories from closing on themselves, short steps now and then
        # get particles out of sharp bends.
        some = _uniform(2, points.xi, generator)
        length = 1.5 * float(0.5 + some[0])
        size = self._size * float(0.7 + 0.6 * some[1])
        factor = size * self._factor
        speed = velocity = normal_like(points.xi, generator)
        end = points
        for _ in range(max(1, min(20, round(length / size)))):
            speed = speed + 0.5 * density.slope(end) @ factor
            end = density.at(end.xi + speed @ factor.T, slopes=True)
            speed = speed + 0.5 * density.slope(end) @ factor
        gain = density.log_density(end) - 0.5 * speed.square().sum(1)
        gain = gain - density.log_density(points) + 0.5 * velocity.square().sum(1)
        chance = torch.nan_to_num(gain, nan=-torch.inf).clamp_max(0.0).exp()
        share = float(chance.mean())
        moved = points.where(_uniform(len(chance), chance, generator) < chance, end)
        self._size *= math.exp(share - 0.75)
        self.fit(density, moved, generator)
        return moved, share


def _metric(xi: Tensor, slope: Tensor) -> Tensor:
    """Cholesky factor (d, d) of the metric in which particles and slopes have one covariance.

    It is the geometric mean of the covariance of the particles and the inverse of that of the
    slopes of the log density: the first tells how far the sheet reaches, the second how thin it
    is; the two agree for a Gaussian.
    """

    def covariance(rows: Tensor) -> Tensor:
        """About zero of rows (n, d), drawn towards its diagonal where rows are few."""
        found = rows.T @ rows / len(rows)
        found = found + 1e-10 * found.diagonal().mean() * torch.eye(len(found)).to(found)
        share = 5.0 / (len(rows) + 5.0)
        return (1.0 - share) * found + share * torch.diag(found.diagonal())

    def power(matrix: Tensor, exponent: float) -> Tensor:
        values, vectors = torch.linalg.eigh(matrix)
        return (vectors * values.clamp_min(1e-30) ** exponent) @ vectors.T

    wide, steep = covariance(xi - xi.mean(0)), covariance(slope)
    root, inverse = power(wide, 0.5), power(wide, -0.5)
    mean = root @ power(inverse @ torch.linalg.inv(steep) @ inverse, 0.5) @ root
    return torch.linalg.cholesky(0.5 * (mean + mean.T))


def accepted(
    points: Points, trial: Points, log_ratio: Tensor, generator: torch.Generator
) -> tuple[Points, float]:
    """Trial particles by their odds (n,), the old ones elsewhere, and the share accepted."""
    odds = torch.nan_to_num(log_ratio, nan=-torch.inf)
    take = _uniform(len(log_ratio), log_ratio, generator).log() < odds
    return points.where(take, trial), float(take.to(torch.float64).mean())


def _uniform(count: int, like: Tensor, generator: torch.Generator) -> Tensor:
    return torch.rand(count, generator=generator, dtype=like.dtype)


def normal_like(like: Tensor, generator: torch.Generator) -> Tensor:
    """Standard normal numbers of the shape and kind of a tensor."""
    return torch.randn(like.shape, generator=generator, dtype=like.dtype)


def distinct_rows(xi: Tensor) -> int:
    """Number of different rows (n, d); a row's first coordinate tells it from all others."""
    return len(torch.unique(xi[:, 0]))


@dataclass(frozen=True, kw_only=True)
class SmcSettings:
    """Settings of the sampler.

    Attributes:
        ess_target: share of the particles that stay effective in a step of tempering.
        moves: of every particle at a level, at most.
        walk_scale: b of the random walk of covariance b^2 S (Ching & Chen 2007).
        independence_moves: of these, the first ones, from a mixture fitted to the particles.
        components: Students of that mixture, at most.
        most_levels: after which the sampler gives up.
        unmoved: share of the particles yet to move at which the moves of a level end (Buchholz,
            Chopin & Jacob 2021); 0 for all moves.
        rows: likelihoods whose derivatives are taken at a time.
    """

    ess_target: float = 0.5
    moves: int = 10
    walk_scale: float = 0.2
    independence_moves: int = 6
    components: int = 8
    most_levels: int = 200
    unmoved: float = 0.1
    rows: int = 128


class TemperedSmc:
    """Sampler for prior x likelihood.

    Args:
        prior: particles live in its standard normal coordinates.
        moves: kinds of moves in their order, and how many of each at a level at most; those of the
            settings where None.
        start: whence the particles come, in standard normal coordinates; the prior where None.
    """

    def __init__(
        self,
        prior: Parameters,
        log_likelihood: LogLikelihood,
        settings: SmcSettings | None = None,
        moves: Sequence[tuple[Move, int]] | None = None,
        start: Mixture | None = None,
    ) -> None:
        self.prior, self.log_likelihood, self.start = prior, log_likelihood, start
        self.settings = chosen = settings or SmcSettings()
        first = max(0, min(chosen.independence_moves, chosen.moves))
        usual = (
            (MixtureIndependence(chosen.components), first),
            (RandomWalk(chosen.walk_scale), chosen.moves - first),
        )
        self.moves: Sequence[tuple[Move, int]] = usual if moves is None else moves

    def _density(self) -> Tempered:
        return Tempered(self.prior, self.log_likelihood, self.settings.rows, self.start)

    def slopes(self, parameters: Tensor) -> Tensor:
        """Of the log likelihood by the coordinates, (n, d), at parameters (n, p)."""
        points = self._density().at(self.prior.to_normal(parameters), slopes=True)
        assert points.slope is not None
        return points.slope

    def run(
        self, particles: int, seed: Seed, progress: Callable[[float], None] | None = None
    ) -> SamplerRun:
        """Sample with one group, whose particles at the end are the draws.

        Args:
            progress: sees beta after every level.

        Raises:
            InferenceError: no finite likelihood, or too many levels.
        """
        density = self._density()
        generator = torch_generator(seed)
        points, log_evidence, levels, _ = self._raised(density, generator, particles, 1, progress)
        return SamplerRun(
            theta=density.parameters(points.xi).cpu(),
            log_likelihood=points.log_likelihood.cpu(),
            log_evidence=float(log_evidence[0]),
            evaluations=density.evaluations,
            levels=levels,
            invalid=density.invalid,
        )

    def draws(
        self,
        particles: int,
        count: int,
        seed: Seed,
        groups: int,
        progress: Callable[[float], None] | None = None,
        kept: Callable[[float], None] | None = None,
    ) -> list[SamplerRun]:
        """At least `count` states of the posterior, by the first move: one run a group.

        Every particle gives as many. Moves keep their tuning once they have settled.

        Args:
            groups: of particles that are resampled apart.
            progress: sees beta after every level.
            kept: sees the share of the states that were kept.

        Raises:
            InferenceError: no finite likelihood, or too many levels.
        """
        density = self._density()
        generator = torch_generator(seed)
        points, evidence, levels, moves = self._raised(
            density, generator, particles, groups, progress
        )
        move = moves[0][0]
        move.fit(density, points, generator)
        for _ in range(6):  # the tuning comes to rest before draws are kept
            points, _ = move.step(density, points, generator)
        theta, value, shares, turns = [], [], [], -(-count // particles)
        for turn in range(turns):
            points, share = move.step(density, points, generator)
            theta.append(density.parameters(points.xi).unflatten(0, (groups, -1)))
            value.append(points.log_likelihood.unflatten(0, (groups, -1)))
            shares.append(share)
            if kept is not None:
                kept((turn + 1) / turns)
        parts = zip(torch.cat(theta, 1), torch.cat(value, 1), evidence.tolist(), strict=True)
        return [
            SamplerRun(
                theta=drawn.cpu(),
                log_likelihood=likelihood.cpu(),
                log_evidence=log_evidence,
                evaluations=density.evaluations // groups,
                levels=levels,
                invalid=density.invalid // groups,
                acceptance=sum(shares) / len(shares),
            )
            for drawn, likelihood, log_evidence in parts
        ]

    def _raised(
        self,
        density: Tempered,
        generator: torch.Generator,
        particles: int,
        groups: int,
        progress: Callable[[float], None] | None,
    ) -> tuple[Points, Tensor, int, list[tuple[Move, int]]]:
        """Particles from the prior to the posterior, log evidence (g,), levels and tuned moves."""
        settings = self.settings
        moves = [*copy.deepcopy(self.moves)]  # a run tunes its own
        if particles < 2:
            raise InferenceError(
                f"the sampler cannot work with {particles} particles; use hundreds"
            )
        first = density.start.sample(particles, generator)
        points = density.at(first, any(move.slopes for move, _ in moves))
        each = particles // groups
        possible = torch.isfinite(points.log_likelihood).unflatten(0, (groups, -1))
        if not bool(possible.any(dim=1).all()):
            raise InferenceError(
                f"none of the {each} first parameter sets has a finite likelihood for "
                "this observation; check that the file and the building belong together, or use "
                "more particles"
            )
        log_evidence, levels = torch.zeros(groups, dtype=torch.float64), 0
        while density.beta < 1.0:
            if levels >= settings.most_levels:
                raise InferenceError(
                    f"the sampler reached only beta = {density.beta:.3g} in "
                    f"{settings.most_levels} levels; use more particles, and check that the "
                    "observation and the building belong together"
                )
            gain, left = density.gain(points).unflatten(0, (groups, -1)), 1.0 - density.beta
            beta = min(next_increment(chain, left, settings.ess_target) for chain in gain)
            log_weight = beta * gain
            rows = [
                k * each + systematic_rows(torch.softmax(chain, dim=0), generator)
                for k, chain in enumerate(log_weight)
            ]
            log_evidence += torch.logsumexp(log_weight, dim=1).cpu() - math.log(each)
            density.beta = min(density.beta + beta, 1.0)
            points = self._moved(density, points.rows(torch.cat(rows)), moves, generator)
            levels += 1
            if progress is not None:
                progress(density.beta)
        return points, log_evidence, levels, moves

    def _moved(
        self,
        density: Tempered,
        points: Points,
        moves: list[tuple[Move, int]],
        generator: torch.Generator,
    ) -> Points:
        """Particles after the moves of a level, one kind after the other."""
        # Copies of few points need all moves to part.
        parted = distinct_rows(points.xi) > 0.25 * len(points.xi)
        enough, start, unmoved = self.settings.unmoved if parted else 0.0, points.xi, 1.0
        for move, count in moves:
            if not count or unmoved < enough:
                continue
            move.fit(density, points, generator)
            for _ in range(count):
                if unmoved < enough:
                    break
                points, _ = move.step(density, points, generator)
                unmoved = float((points.xi == start).all(dim=1).to(torch.float64).mean())
        return points
