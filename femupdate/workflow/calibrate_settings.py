"""How a posterior is sampled, and what a sampler gives."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from femupdate.discrepancy.likelihood import EffectLikelihood
from femupdate.inference.bridge import BridgeResult
from femupdate.inference.importance import WeightedDraws
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.learned import LearnedLikelihood
from femupdate.inference.parameters import Parameters
from femupdate.inference.posterior import DrawnBy
from femupdate.inference.smc import SmcResult, SmcSettings
from femupdate.inference.thresholds import MAXIMA
from femupdate.seeds import Seed
from femupdate.workflow.thresholds import CALIBRATION

ABOUT_MAXIMA = "importance sampling about the maxima"
_FEW_COUNT = "Few importance draws count: the posterior may be wider, or of several pieces."


@dataclass(frozen=True)
class CalibrationSettings:
    """How to sample.

    Attributes:
        particles: in all; shared among independent runs.
        exact: data-space likelihood instead of the latent one.
        chains: independent runs, so that their agreement can be judged.
        seed: of the sampler.
        device: where the likelihood is evaluated.
        anyway: store a posterior even of an observation that is unlike the building.
        smc: settings of the sampler.
    """

    particles: int = 5000
    exact: bool = False
    chains: int = CALIBRATION.chains
    seed: int = 0
    device: str = "cpu"
    anyway: bool = False
    smc: SmcSettings = field(default_factory=SmcSettings)


@dataclass(frozen=True)
class Sampled:
    """What a sampler has drawn.

    Attributes:
        results: of the independent runs.
        parameters: that the columns of their draws are.
        drawn: how.
        notes: how it went, in sentences.
        latent: of the latent likelihood, where it was found by a search.
        least_noise: standard deviation of ln|H| below which the likelihood does not believe the
            file's noise.
        learned: likelihood of the data with the error of the model that they show.
        effects: likelihood of all that was measured by a model with effects; None where it was
            that of `learned`.
        warnings: what whoever uses the draws should know, in sentences.
    """

    results: list[SmcResult]
    parameters: Parameters
    drawn: DrawnBy
    notes: tuple[str, ...]
    latent: FoundLatent | None = None
    least_noise: float = 0.0
    learned: LearnedLikelihood | None = None
    effects: EffectLikelihood | None = None
    warnings: tuple[str, ...] = ()


def by_runs(
    likelihood: str, way: str, results: list[SmcResult], *, evidence: bool = False
) -> DrawnBy:
    """What runs apart say: their spread is the error of their mean evidence."""
    known = np.array([result.log_evidence for result in results])
    return DrawnBy(
        likelihood=likelihood,
        way=way,
        chains=len(results),
        evaluations=sum(result.evaluations for result in results),
        log_evidence=float(logsumexp(known) - np.log(len(known))) if evidence else None,
        log_evidence_error=(
            float(known.std(ddof=1) / len(known) ** 0.5) if evidence and len(known) > 1 else None
        ),
    )


def about_maxima(
    prior: Parameters, found: WeightedDraws, count: int, seed: Seed, *notes: str
) -> Sampled:
    """Equally weighted draws, `count` of them, of weighted ones about the maxima."""
    theta, value = found.resample(count, seed)
    result = SmcResult(theta, value, found.log_evidence, (), found.evaluations, 0)
    few = found.effective < MAXIMA.trusted * len(found.points)
    drawn = by_importance(ABOUT_MAXIMA, [found])
    return Sampled([result], prior, drawn, notes, warnings=(_FEW_COUNT,) * few)


def by_importance(way: str, results: Sequence[BridgeResult | WeightedDraws]) -> DrawnBy:
    """What importance samples say that are independent of each other, one at least."""
    known = np.array([result.log_evidence for result in results])
    errors = np.array([result.log_evidence_error for result in results])
    return DrawnBy(
        likelihood="exact",
        way=way,
        chains=len(results),
        evaluations=sum(result.evaluations for result in results),
        effective_sample_size=sum(result.effective for result in results),
        log_evidence=float(logsumexp(known) - np.log(len(known))),
        log_evidence_error=float(np.sqrt((errors**2).sum()) / len(errors)),
    )


def plain_settings(settings: CalibrationSettings) -> dict[str, object]:
    """Settings as the study's record and the posterior keep them."""
    return {
        "particles": settings.particles,
        "chains": settings.chains,
        "seed": settings.seed,
        "exact": settings.exact,
        "ess_target": settings.smc.ess_target,
        "moves": settings.smc.moves,
        "walk_scale": settings.smc.walk_scale,
        "independence_moves": settings.smc.independence_moves,
    }
