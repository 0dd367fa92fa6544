"""Metropolis-Hastings moves of tempered particles; a move of one's own is an object like these."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from femupdate.inference.importance import StudentMixture, fit_mixture
from femupdate.inference.tempering import Points, Tempered


@dataclass(frozen=True)
class MoveState:
    """What a move goes by within a level.

    Attributes:
        tuning: what it has learned and takes to the next level, such as a length of step.
        fitted: to the particles of this level, such as the factor of a covariance.
    """

    tuning: float = math.nan
    fitted: Any = None


class Move(Protocol):
    """Moves all particles so that the tempered density stays what it is.

    Random numbers come from the generator alone, whose state is part of the sampler's.
    """

    @property
    def slopes(self) -> bool:
        """Whether it needs the derivatives of the log likelihood."""
        ...

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> MoveState:
        """The state for a level; the tuning is NaN before the first."""
        ...

    def step(
        self, density: Tempered, points: Points, state: MoveState, generator: torch.Generator
    ) -> tuple[Points, MoveState, float]:
        """Particles and state after one move of all, and the share of the moves accepted."""
        ...


Schedule = Sequence[tuple[Move, int]]
"""Moves of a level, one kind after the other, and how many of each at most."""


@dataclass(frozen=True)
class RandomWalk:
    """Steps of covariance b^2 S, S that of the particles (Ching & Chen 2007, J. Eng. Mech. 133)."""

    scale: float
    slopes: bool = False

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> MoveState:
        """Factor of the covariance of the particles, with a ridge for degenerate sets."""
        size = points.xi.shape[1]
        covariance = torch.cov(points.xi.T).reshape(size, size)
        ridge = 1e-10 * torch.eye(size).to(points.xi)
        return MoveState(tuning, self.scale * torch.linalg.cholesky(covariance + ridge))

    def step(
        self, density: Tempered, points: Points, state: MoveState, generator: torch.Generator
    ) -> tuple[Points, MoveState, float]:
        """One step of every particle."""
        trial = density.at(points.xi + normal_like(points.xi, generator) @ state.fitted.T)
        log_ratio = density.log_density(trial) - density.log_density(points)
        points, share = accepted(points, trial, log_ratio, generator)
        return points, state, share


@dataclass(frozen=True)
class MixtureIndependence:
    """Draws from a mixture of Students fitted to the particles, whatever the particle was.

    Attributes:
        components: Students of the mixture, at most.
        distinct: different particles that a Student needs, for every coordinate and its weight:
            on a few points it would propose those again and again.
        fitted: particles for every Student that the fit looks at.
        freedom: degrees of freedom of the tails.
        widen: factor on the covariances; particles lag behind where the likelihood moves on.
    """

    components: int = 8
    distinct: int = 5
    fitted: int = 500
    freedom: int = 4
    widen: float = 1.5
    slopes: bool = False

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> MoveState:
        """The mixture."""
        xi, some = points.xi, self.fitted * self.components
        most = max(1, distinct_rows(xi) // (self.distinct * (xi.shape[1] + 1)))
        if len(xi) > some:
            xi = xi[torch.randperm(len(xi), generator=generator, device=xi.device)[:some]]
        found = fit_mixture(xi, min(self.components, most), generator)
        return MoveState(tuning, StudentMixture(found.widened(self.widen), self.freedom))

    def step(
        self, density: Tempered, points: Points, state: MoveState, generator: torch.Generator
    ) -> tuple[Points, MoveState, float]:
        """One proposal for every particle."""
        mixture: StudentMixture = state.fitted
        trial = density.at(mixture.sample(len(points.xi), generator))
        log_ratio = (
            density.log_density(trial)
            - density.log_density(points)
            + mixture.log_density(points.xi)
            - mixture.log_density(trial.xi)
        )
        points, share = accepted(points, trial, log_ratio, generator)
        return points, state, share


@dataclass(frozen=True)
class Hamiltonian:
    """Trajectories by the leapfrog rule, in the metric of particles and slopes.

    In dozens of dimensions the posterior of stiffness factors is a thin curved sheet of several
    parts: what the data determine well bends along what they leave open. Trajectories (Neal 2011,
    Handbook of Markov Chain Monte Carlo, ch. 5) follow the bends.

    Attributes:
        length: mean length of a trajectory, of the metric.
        acceptance: share of accepted trajectories that is aimed at.
        diagonal: draws from the diagonal that count beside the particles in a covariance.
    """

    length: float = 1.5
    acceptance: float = 0.75
    most_steps: int = 20
    first_step: float = 0.3
    diagonal: float = 5.0
    slopes: bool = True

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> MoveState:
        """The step, and Cholesky factor (d, d) of the metric."""
        step = self.first_step if math.isnan(tuning) else tuning
        return MoveState(step, metric(points.xi, density.slope(points), self.diagonal))

    def step(
        self, density: Tempered, points: Points, state: MoveState, generator: torch.Generator
    ) -> tuple[Points, MoveState, float]:
        """One trajectory of every particle; the step and the metric adapt."""
        # Lengths that vary keep trajectories from closing on themselves, short steps now and then
        # get particles out of sharp bends.
        some = uniform(2, points.xi, generator)
        length = self.length * float(0.5 + some[0])
        size = state.tuning * float(0.7 + 0.6 * some[1])
        factor = size * state.fitted
        speed = velocity = normal_like(points.xi, generator)
        end = points
        for _ in range(max(1, min(self.most_steps, round(length / size)))):
            speed = speed + 0.5 * density.slope(end) @ factor
            end = density.at(end.xi + speed @ factor.T, slopes=True)
            speed = speed + 0.5 * density.slope(end) @ factor
        gain = density.log_density(end) - 0.5 * speed.square().sum(1)
        gain = gain - density.log_density(points) + 0.5 * velocity.square().sum(1)
        chance = torch.nan_to_num(gain, nan=-torch.inf).clamp_max(0.0).exp()
        share = float(chance.mean())
        moved = points.where(uniform(len(chance), chance, generator) < chance, end)
        step = state.tuning * math.exp(share - self.acceptance)
        fitted = metric(moved.xi, density.slope(moved), self.diagonal)
        return moved, MoveState(step, fitted), share


def metric(xi: Tensor, slope: Tensor, diagonal: float) -> Tensor:
    """Cholesky factor (d, d) of the metric in which particles and slopes have one covariance.

    It is the geometric mean of the covariance of the particles and the inverse of that of the
    slopes of the log density: the first tells how far the sheet reaches, the second how thin it
    is; the two agree for a Gaussian.
    """
    wide, steep = _covariance(xi - xi.mean(0), diagonal), _covariance(slope, diagonal)
    root, inverse = _power(wide, 0.5), _power(wide, -0.5)
    mean = root @ _power(inverse @ torch.linalg.inv(steep) @ inverse, 0.5) @ root
    return torch.linalg.cholesky(0.5 * (mean + mean.T))


def _covariance(rows: Tensor, diagonal: float) -> Tensor:
    """(d, d) about zero of rows (n, d), drawn towards its diagonal where rows are few."""
    found = rows.T @ rows / len(rows)
    found = found + 1e-10 * found.diagonal().mean() * torch.eye(len(found)).to(found)
    share = diagonal / (len(rows) + diagonal)
    return (1.0 - share) * found + share * torch.diag(found.diagonal())


def _power(matrix: Tensor, power: float) -> Tensor:
    """Of a symmetric positive matrix (d, d)."""
    values, vectors = torch.linalg.eigh(matrix)
    return (vectors * values.clamp_min(1e-30) ** power) @ vectors.T


def accepted(
    points: Points, trial: Points, log_ratio: Tensor, generator: torch.Generator
) -> tuple[Points, float]:
    """Trial particles by their odds (n,), the old ones elsewhere, and the share accepted."""
    take = uniform(len(log_ratio), log_ratio, generator).log() < torch.nan_to_num(
        log_ratio, nan=-torch.inf
    )
    return points.where(take, trial), float(take.to(torch.float64).mean())


def uniform(count: int, like: Tensor, generator: torch.Generator) -> Tensor:
    """(count,) of the kind of a tensor."""
    return torch.rand(count, generator=generator, dtype=like.dtype, device=like.device)


def normal_like(like: Tensor, generator: torch.Generator) -> Tensor:
    """Standard normal numbers of the shape and kind of a tensor."""
    return torch.randn(like.shape, generator=generator, dtype=like.dtype, device=like.device)


def distinct_rows(xi: Tensor) -> int:
    """Number of different rows (n, d); a row's first coordinate tells it from all others."""
    return len(torch.unique(xi[:, 0]))
