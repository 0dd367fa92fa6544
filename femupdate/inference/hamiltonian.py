"""Moves by trajectories of Hamiltonian dynamics, alone or judged by a costlier likelihood.

In dozens of dimensions the posterior of stiffness factors is a thin curved sheet of several parts:
what the data determine well bends along what they leave open. Leapfrog trajectories (Neal 2011,
Handbook of Markov Chain Monte Carlo, ch. 5) follow the bends; particles that come from the prior
with the likelihood raised to growing powers reach all parts by their masses.
"""

import math
from dataclasses import dataclass, field

import torch
from torch import Tensor

from femupdate.inference.moves import Tuned, normal_like, uniform
from femupdate.inference.tempering import Points, Slopes, Tempered
from femupdate.thresholds import entry


@dataclass(frozen=True)
class Rolling(Tuned):
    """The tuning is the step in units of the metric, `factor` (d, d) its Cholesky factor."""

    factor: Tensor = field(default_factory=lambda: torch.empty(0))


@dataclass(frozen=True)
class Hamiltonian:
    """Trajectories by the leapfrog rule, in the metric of particles and slopes."""

    length: float = entry(1.5, "of the metric", "mean length of a trajectory")
    acceptance: float = entry(0.75, "share", "of accepted trajectories that is aimed at")
    most_steps: int = entry(20, "steps", "of a trajectory, at most")
    first_step: float = entry(0.3, "of the metric", "first step")
    diagonal: float = entry(
        5.0, "draws", "from the diagonal that count beside the particles in a covariance"
    )
    slopes: Slopes = "both"

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> Rolling:
        """The metric."""
        step = self.first_step if math.isnan(tuning) else tuning
        return Rolling(step, metric(points.xi, density.slope(points), self.diagonal))

    def step(
        self, density: Tempered, points: Points, state: Rolling, generator: torch.Generator
    ) -> tuple[Points, Rolling, float]:
        """One trajectory of every particle; the step and the metric adapt."""
        # Lengths that vary keep trajectories from closing on themselves, short steps now and then
        # get particles out of sharp bends.
        some = uniform(2, points.xi, generator)
        length = self.length * float(0.5 + some[0])
        size = state.tuning * float(0.7 + 0.6 * some[1])
        steps = max(1, min(self.most_steps, round(length / size)))
        velocity = normal_like(points.xi, generator)
        end, speed = _followed(density, points, velocity, size * state.factor, steps)
        gain = density.log_density(end) - 0.5 * speed.square().sum(1)
        gain = gain - density.log_density(points) + 0.5 * velocity.square().sum(1)
        chance = torch.nan_to_num(gain, nan=-torch.inf).clamp_max(0.0).exp()
        share = float(chance.mean())
        moved = points.where(uniform(len(chance), chance, generator) < chance, end)
        step = state.tuning * math.exp(share - self.acceptance)
        factor = metric(moved.xi, density.slope(moved), self.diagonal)
        return moved, Rolling(step, factor), share


@dataclass(frozen=True)
class DelayedAcceptance:
    """Trajectories along the base, a cheap likelihood, whose ends the target judges.

    What the base accepts the target judges once more (delayed acceptance, Christen & Fox 2005, J.
    Comput. Graph. Stat. 14, 795): one target likelihood a move, and none of its slopes.

    Attributes:
        along: the trajectories; their step stays what it was at the base.
    """

    along: Hamiltonian = field(default_factory=Hamiltonian)
    slopes: Slopes = "base"

    def init(
        self, density: Tempered, points: Points, tuning: float, generator: torch.Generator
    ) -> Rolling:
        """The metric of the base."""
        return self.along.init(_base_of(density), _on_base(points), tuning, generator)

    def step(
        self, density: Tempered, points: Points, state: Rolling, generator: torch.Generator
    ) -> tuple[Points, Rolling, float]:
        """One trajectory of every particle, and the share that both likelihoods accept."""
        tried, _, _ = self.along.step(_base_of(density), _on_base(points), state, generator)
        moved = (tried.xi != points.xi).any(dim=1)
        target = points.target.clone()
        target[moved] = density.value(tried.xi[moved])
        trial = Points(tried.xi, tried.target, target, tried.target_slope, points.target_slope)
        chance = (density.beta * (trial.gain() - points.gain())).clamp_max(0.0).exp()
        take = moved & (uniform(len(chance), chance, generator) < chance)
        return points.where(take, trial), state, float(take.double().mean())


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


def _followed(
    density: Tempered, start: Points, velocity: Tensor, factor: Tensor, steps: int
) -> tuple[Points, Tensor]:
    """Points and velocities (n, d) after so many steps of the leapfrog rule."""
    end = start
    for _ in range(steps):
        velocity = velocity + 0.5 * density.slope(end) @ factor
        end = density.at(end.xi + velocity @ factor.T, "both")
        velocity = velocity + 0.5 * density.slope(end) @ factor
    return end, velocity


def _base_of(density: Tempered) -> Tempered:
    """The base at its whole power, as a density of its own."""
    assert density.base is not None
    return Tempered(density.prior, density.base, None, 1.0, density.rows)


def _on_base(points: Points) -> Points:
    """Points as the base alone sees them."""
    slope = points.base_slope
    assert slope is not None
    return Points(points.xi, torch.zeros_like(points.base), points.base, 0.0 * slope, slope)


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
