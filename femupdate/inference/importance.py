"""From good particles to nearly independent draws and a precise evidence, by importance sampling.

A Gaussian mixture fitted to particles, with Student tails, covers the posterior so well that most
of its draws count; their weights repair what the particles had wrong (adaptive importance
sampling: Cappe et al. 2008, Stat. Comput. 18, 447).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.mixture import StudentMixture, fit_mixture
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.inference.tempering import (
    effective_sample_size,
    next_increment,
    systematic_rows,
)
from femupdate.seeds import Seed, torch_generator

# Distinct draws that a component needs, a coordinate and its weight: on fewer it is too narrow.
_DISTINCT_PER_COORDINATE = 25
# Draws of a round of fitting, at least, and a coordinate: they must tell all covariances.
_LEAST_DRAWS, _DRAWS_PER_COORDINATE = 200, 100


@dataclass(frozen=True)
class ImportanceSettings:
    """How the proposal is fitted.

    Attributes:
        components: of the mixture.
        rounds: of fitting, at most.
        enough: share of effective draws that ends them.
        tempered_share: effective share of the draws that every fit uses at least.
        widen: factor on the covariances, so that tails are covered.
    """

    components: int = 12
    rounds: int = 8
    enough: float = 0.5
    tempered_share: float = 0.4
    widen: float = 1.2


@dataclass(frozen=True)
class WeightedDraws:
    """Independent draws from a proposal, weighted to the posterior.

    Attributes:
        theta: (n, p).
        log_likelihood: (n,).
        log_weight: (n,) prior times likelihood over proposal.
        evaluations: likelihoods evaluated to get here.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_weight: Tensor
    evaluations: int

    @property
    def effective(self) -> float:
        """Effective sample size."""
        return effective_sample_size(self.log_weight)

    @property
    def log_evidence(self) -> float:
        """Log of the mean likelihood under the prior."""
        return float(torch.logsumexp(self.log_weight, 0)) - math.log(len(self.log_weight))

    @property
    def log_evidence_error(self) -> float:
        """Standard error of `log_evidence`, by the delta method."""
        count = len(self.log_weight)
        return math.sqrt(max(0.0, 1.0 / self.effective - 1.0 / count))

    def resample(self, count: int, seed: Seed) -> tuple[Tensor, Tensor]:
        """Equally weighted draws (count, p) and their log likelihoods.

        Systematic, in the order of the first parameter: the shares of well separated modes are
        kept to one draw. Fewer than the effective size repeat few draws.
        """
        generator = torch_generator(seed, self.theta.device)
        order = self.theta[:, 0].argsort()
        weight = torch.softmax(self.log_weight[order], dim=0)
        rows = order[systematic_rows(weight, generator, count)]
        rows = rows[torch.randperm(count, generator=generator, device=rows.device)]
        return self.theta[rows], self.log_likelihood[rows]

    def independent(self, seed: Seed) -> tuple[Tensor, Tensor]:
        """Draws kept by rejection, each once: independent, but for the weight that is taken as
        the largest possible, the largest seen."""
        generator = torch_generator(seed, self.theta.device)
        uniform = torch.rand(
            len(self.log_weight),
            generator=generator,
            dtype=torch.float64,
            device=self.theta.device,
        )
        kept = uniform.log() < self.log_weight - self.log_weight.max()
        return self.theta[kept], self.log_likelihood[kept]


def importance_draws(
    prior: UniformPrior,
    log_likelihood: LogLikelihood,
    particles: Tensor,
    count: int,
    seed: Seed,
    settings: ImportanceSettings | None = None,
) -> WeightedDraws:
    """Draw `count` weighted parameter vectors around particles (n, p) of every posterior mode.

    The proposal is first fitted again in rounds of n draws, until enough of them count; weights
    that few draws would share are tempered there (Koblents & Miguez 2015, Stat. Comput. 25, 407),
    so that no mode is lost on the way. Modes that hold no particle are missed: the particles must
    come from a sampler that finds them.

    Raises:
        InferenceError: no draw has a finite likelihood.
    """
    settings = settings or ImportanceSettings()
    generator = torch_generator(seed, prior.lower.device)
    xi = prior.to_normal(particles).clamp(-8.0, 8.0)
    size = max(len(particles), _LEAST_DRAWS, _DRAWS_PER_COORDINATE * prior.size)
    evaluations = 0
    for _ in range(settings.rounds):
        mixture = _fit(xi, settings, generator)
        proposal, _, log_weight = _weighted(prior, log_likelihood, mixture, size, generator)
        evaluations += size
        power = next_increment(log_weight, 1.0, settings.tempered_share)
        xi = proposal[systematic_rows(torch.softmax(power * log_weight, 0), generator)]
        if effective_sample_size(log_weight) > settings.enough * size:
            break
    mixture = _fit(xi, settings, generator)
    proposal, value, log_weight = _weighted(prior, log_likelihood, mixture, count, generator)
    return WeightedDraws(prior.from_normal(proposal), value, log_weight, evaluations + count)


def _weighted(
    prior: UniformPrior,
    log_likelihood: LogLikelihood,
    mixture: StudentMixture,
    count: int,
    generator: torch.Generator,
) -> tuple[Tensor, Tensor, Tensor]:
    """Draws in standard normal coordinates (n, p), log likelihoods (n,) and log weights (n,)."""
    proposal = mixture.sample(count, generator)
    value = log_likelihood(prior.from_normal(proposal)).to(torch.float64)
    value = torch.where(torch.isfinite(value), value, -torch.inf)
    constant = 0.5 * prior.size * math.log(2.0 * math.pi)
    log_prior = prior.log_density_normal(proposal) - constant
    log_weight = value + log_prior - mixture.log_density(proposal)
    if not bool(torch.isfinite(log_weight).any()):
        raise InferenceError(
            "no draw around the particles has a finite likelihood; use more particles"
        )
    return proposal, value, log_weight


def _fit(xi: Tensor, settings: ImportanceSettings, generator: torch.Generator) -> StudentMixture:
    distinct = len(torch.unique(xi[:, 0]))
    most = max(1, distinct // (_DISTINCT_PER_COORDINATE * (xi.shape[1] + 1)))
    fitted = fit_mixture(xi, min(settings.components, most), generator, iterations=100)
    return StudentMixture(fitted.widened(settings.widen))
