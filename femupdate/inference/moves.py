"""Metropolis-Hastings moves of tempered particles; a move of one's own is an object like these."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import torch
from torch import Tensor

from femupdate.inference.mixture import StudentMixture, fit_mixture
from femupdate.inference.tempering import Points, Slopes, Tempered
from femupdate.thresholds import entry


class MoveState(Protocol):
    """What a move goes by within a level."""

    @property
    def tuning(self) -> float:
        """What it has learned and takes to the next level, such as a length of step."""
        ...


class Move(Protocol):
    """Moves all particles so that the tempered density stays what it is.

    Random numbers come from the generator alone, whose state is part of the sampler's.
    """

    @property
    def slopes(self) -> Slopes:
        """Of which log likelihoods it needs the derivatives."""
        ...

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> Any:
        """A `MoveState` for a level; the tuning is NaN before the first."""
        ...

    def step(
        self, density: Tempered, points: Points, state: Any, generator: torch.Generator
    ) -> tuple[Points, Any, float]:
        """Particles and state after one move of all, and the share of the moves accepted."""
        ...


Schedule = Sequence[tuple[Move, int]]
"""Moves of a level, one kind after the other, and how many of each at most."""


@dataclass(frozen=True)
class Tuned:
    """The state of a move that needs no more than its tuning."""

    tuning: float = math.nan


@dataclass(frozen=True)
class Walking(Tuned):
    """Lower factor (d, d) of the covariance of the steps."""

    factor: Tensor = field(default_factory=lambda: torch.empty(0))


@dataclass(frozen=True)
class RandomWalk:
    """Steps of covariance b^2 S, S that of the particles (Ching & Chen 2007, J. Eng. Mech. 133).

    Attributes:
        scale: b.
    """

    scale: float
    slopes: Slopes = "none"

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> Walking:
        """The covariance of the particles."""
        return Walking(tuning, self.scale * _covariance_factor(points.xi))

    def step(
        self, density: Tempered, points: Points, state: Walking, generator: torch.Generator
    ) -> tuple[Points, Walking, float]:
        """One step of every particle."""
        trial = density.at(points.xi + normal_like(points.xi, generator) @ state.factor.T)
        log_ratio = density.log_density(trial) - density.log_density(points)
        points, share = accepted(points, trial, log_ratio, generator)
        return points, state, share


@dataclass(frozen=True)
class Proposing(Tuned):
    """The mixture that is drawn from."""

    mixture: StudentMixture | None = None


@dataclass(frozen=True)
class MixtureIndependence:
    """Draws from a mixture fitted to the particles, whatever the particle was."""

    components: int = entry(8, "Students", "of the mixture, at most")
    distinct: int = entry(
        5,
        "particles",
        "distinct, that a Student needs, for every coordinate and weight",
        "on a few points it would propose those again and again",
    )
    fitted: int = entry(500, "particles", "for every Student that the fit looks at")
    freedom: int = entry(4, "degrees", "of freedom of its tails")
    widen: float = entry(
        1.5,
        "factor",
        "on the covariances",
        "particles lag behind where the likelihood moves on",
    )
    slopes: Slopes = "none"

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> Proposing:
        """The mixture."""
        xi, some = points.xi, self.fitted * self.components
        most = max(1, distinct_rows(xi) // (self.distinct * (xi.shape[1] + 1)))
        if len(xi) > some:
            xi = xi[torch.randperm(len(xi), generator=generator, device=xi.device)[:some]]
        fitted = fit_mixture(xi, min(self.components, most), generator)
        return Proposing(tuning, StudentMixture(fitted.widened(self.widen), self.freedom))

    def step(
        self, density: Tempered, points: Points, state: Proposing, generator: torch.Generator
    ) -> tuple[Points, Proposing, float]:
        """One proposal for every particle."""
        mixture = state.mixture
        assert mixture is not None
        trial = density.at(mixture.sample(len(points.xi), generator))
        log_ratio = (
            density.log_density(trial)
            - density.log_density(points)
            + mixture.log_density(points.xi)
            - mixture.log_density(trial.xi)
        )
        points, share = accepted(points, trial, log_ratio, generator)
        return points, state, share


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


def _covariance_factor(xi: Tensor) -> Tensor:
    """Lower factor of the particles' covariance, with a ridge for degenerate sets."""
    covariance = torch.cov(xi.T).reshape(xi.shape[1], xi.shape[1])
    ridge = 1e-10 * torch.eye(xi.shape[1], dtype=xi.dtype, device=xi.device)
    return torch.linalg.cholesky(covariance + ridge)
