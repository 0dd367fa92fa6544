"""From good particles to nearly independent draws and a precise evidence, by importance sampling.

A Gaussian mixture with Student tails covers the posterior so well that most of its draws count;
their weights repair what the mixture has wrong (adaptive importance sampling: Cappe et al. 2008,
Stat. Comput. 18, 447; about a maximum: Geweke 1989, Econometrica 57, 1317).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.mixture import StudentMixture, fit_mixture
from femupdate.inference.parameters import Parameters
from femupdate.inference.sampler_run import SamplerRun
from femupdate.inference.tempering import (
    LogLikelihood,
    effective_sample_size,
    next_increment,
    systematic_rows,
)
from femupdate.inference.thresholds import DRAWS
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.thresholds import entry

LogTarget = Callable[[Tensor], tuple[Tensor, Tensor]]
"""Log prior density (n,) and log likelihood (n,) of points (n, d); minus infinity for impossible
ones."""


@dataclass(frozen=True, kw_only=True)
class ImportanceSettings:
    """How the proposal of importance draws is fitted."""

    components: int = entry(12, "Students", "of the proposal, at most")
    rounds: int = entry(8, "rounds", "of fitting, at most")
    enough: float = entry(0.5, "share", "of effective draws that ends them")
    tempered_share: float = entry(
        0.4,
        "share",
        "of the draws that every fit uses at least; weights are tempered, so that no mode is lost",
        "Koblents and Miguez (2015), Stat. Comput. 25, 407",
    )
    widen: float = entry(1.2, "factor", "on the covariances, so that tails are covered")
    freedom: int = entry(8, "degrees", "of freedom of the Student tails")
    distinct: int = entry(
        DRAWS.distinct, "draws", "distinct, that a Student needs, for every coordinate and weight"
    )
    least_draws: int = entry(200, "draws", "of a round of fitting, at least")
    draws_per_coordinate: int = entry(
        100, "draws", "of a round for every coordinate: they must tell all covariances"
    )

    def round_of(self, coordinates: int) -> int:
        """Draws of a round of fitting."""
        return max(self.least_draws, self.draws_per_coordinate * coordinates)


@dataclass(frozen=True)
class WeightedDraws:
    """Independent draws from a proposal, weighted to the posterior.

    Attributes:
        points: (n, d) in the target's coordinates, or the parameters of those.
        log_likelihood: (n,).
        log_weight: (n,) prior times likelihood over proposal.
        evaluations: likelihoods evaluated to get here.
    """

    points: Tensor
    log_likelihood: Tensor
    log_weight: Tensor
    evaluations: int

    @property
    def effective(self) -> float:
        """Effective sample size; zero where no draw is possible."""
        if not bool(torch.isfinite(self.log_weight).any()):
            return 0.0
        return effective_sample_size(self.log_weight)

    @property
    def effective_share(self) -> float:
        """Of the draws."""
        return self.effective / len(self.points)

    @property
    def log_evidence(self) -> float:
        """Log of the mean likelihood under the prior."""
        return float(torch.logsumexp(self.log_weight, 0)) - math.log(len(self.log_weight))

    @property
    def log_evidence_error(self) -> float:
        """Standard error of `log_evidence`, by the delta method."""
        count = len(self.log_weight)
        return math.sqrt(max(0.0, 1.0 / self.effective - 1.0 / count))

    def resampled(self, count: int, seed: Seed) -> SamplerRun:
        """So many equally weighted draws.

        Systematic, in the order of the first coordinate: the shares of well separated modes are
        kept to one draw. Fewer than the effective size repeat few draws.
        """
        generator = torch_generator(seed, self.points.device)
        order = self.points[:, 0].argsort()
        weight = torch.softmax(self.log_weight[order], dim=0)
        rows = order[systematic_rows(weight, generator, count)]
        rows = rows[torch.randperm(count, generator=generator, device=rows.device)]
        return SamplerRun(
            theta=self.points[rows],
            log_likelihood=self.log_likelihood[rows],
            log_evidence=self.log_evidence,
            evaluations=self.evaluations,
            log_evidence_error=self.log_evidence_error,
            effective=self.effective,
            effective_share=self.effective_share,
        )

    def independent(self, seed: Seed) -> tuple[Tensor, Tensor]:
        """Draws kept by rejection, each once: independent, but for the weight that is taken as
        the largest possible, the largest seen."""
        generator = torch_generator(seed, self.points.device)
        uniform = torch.rand(
            len(self.log_weight),
            generator=generator,
            dtype=torch.float64,
            device=self.points.device,
        )
        kept = uniform.log() < self.log_weight - self.log_weight.max()
        return self.points[kept], self.log_likelihood[kept]


class Counted:
    """A likelihood that counts its evaluations and tells of them as they are made.

    Args:
        target: the likelihood.
        progress: advances by one an evaluation.
        rows: evaluated before it advances.
    """

    def __init__(
        self,
        target: LogLikelihood,
        progress: Progress = SILENT,
        rows: int = 256,
    ) -> None:
        self._target, self._progress, self._rows = target, progress, rows
        self.count = 0

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        values = []
        for some in parameters.split(self._rows):
            values.append(self._target(some))
            self.count += len(some)
            self._progress.advance(len(some))
        return torch.cat(values)


def weighted_draws(
    target: LogTarget, proposal: StudentMixture, count: int, generator: torch.Generator
) -> WeightedDraws:
    """`count` draws of a proposal, weighted to the target; none of them need be possible."""
    points = proposal.sample(count, generator)
    log_prior, value = target(points)
    value = torch.where(torch.isfinite(value), value.to(torch.float64), -torch.inf)
    log_weight = value + log_prior - proposal.log_density(points)
    return WeightedDraws(points, value, log_weight, count)


def sampled(
    target: LogTarget,
    proposal: StudentMixture,
    count: int,
    seed: Seed,
    settings: ImportanceSettings | None = None,
) -> WeightedDraws:
    """`count` weighted draws, after rounds in which the proposal is fitted to its own draws.

    Modes that the first proposal does not reach are missed.

    Raises:
        InferenceError: no draw has a finite likelihood.
    """
    settings = settings or ImportanceSettings()
    generator = torch_generator(seed, proposal.gaussian.mean.device)
    size, spent = settings.round_of(proposal.gaussian.mean.shape[1]), 0
    for _ in range(settings.rounds):
        tried = _possible(weighted_draws(target, proposal, size, generator))
        spent += size
        power = next_increment(tried.log_weight, 1.0, settings.tempered_share)
        weight = torch.softmax(power * tried.log_weight, 0)
        proposal = fitted_proposal(
            tried.points[systematic_rows(weight, generator)], settings, generator
        )
        if tried.effective > settings.enough * size:
            break
    found = _possible(weighted_draws(target, proposal, count, generator))
    return replace(found, evaluations=spent + count)


def importance_draws(
    prior: Parameters,
    log_likelihood: LogLikelihood,
    particles: Tensor,
    count: int,
    seed: Seed,
    settings: ImportanceSettings | None = None,
) -> WeightedDraws:
    """Draw `count` weighted parameter vectors around particles (n, p) of every posterior mode.

    Modes that hold no particle are missed: the particles must come from a sampler that finds them.

    Raises:
        InferenceError: no draw has a finite likelihood.
    """
    settings = settings or ImportanceSettings()
    least = max(len(particles), settings.round_of(prior.size))
    settings = replace(settings, least_draws=least)
    fitting, drawing = spawn(seed, 2)
    xi = prior.to_normal(particles).clamp(-DRAWS.edge, DRAWS.edge)
    proposal = fitted_proposal(xi, settings, torch_generator(fitting, xi.device))
    found = sampled(normal_target(prior, log_likelihood), proposal, count, drawing, settings)
    return replace(found, points=prior.from_normal(found.points))


def normal_target(prior: Parameters, log_likelihood: LogLikelihood) -> LogTarget:
    """A likelihood of parameters as a target in the prior's standard normal coordinates."""
    constant = 0.5 * prior.size * math.log(2.0 * math.pi)

    def target(xi: Tensor) -> tuple[Tensor, Tensor]:
        return prior.log_density_normal(xi) - constant, log_likelihood(prior.from_normal(xi))

    return target


def fitted_proposal(
    points: Tensor, settings: ImportanceSettings, generator: torch.Generator
) -> StudentMixture:
    """A mixture fitted to points (n, d), of fewer components where few of them are distinct."""
    distinct = len(torch.unique(points[:, 0]))
    most = max(1, distinct // (settings.distinct * (points.shape[1] + 1)))
    fitted = fit_mixture(points, min(settings.components, most), generator, iterations=100)
    return StudentMixture(fitted.widened(settings.widen), settings.freedom)


def _possible(draws: WeightedDraws) -> WeightedDraws:
    if draws.effective == 0.0:
        raise InferenceError(
            "no draw around the particles has a finite likelihood; use more particles"
        )
    return draws
