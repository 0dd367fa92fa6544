"""How a posterior is sampled, and what a sampler gives."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from femupdate.inference.bridge import BridgeResult
from femupdate.inference.importance import WeightedDraws
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.parameters import Parameters
from femupdate.inference.posterior import DrawnBy
from femupdate.inference.smc import SmcResult, SmcSettings
from femupdate.workflow.thresholds import CALIBRATION


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
        likelihood: of what was measured, with the errors of the model that the data show.
        latent: of the latent likelihood, where it was found by a search.
        least_noise: standard deviation of ln|H| below which the likelihood does not believe the
            file's noise.
        warnings: what whoever uses the draws should know, in sentences.
    """

    results: list[SmcResult]
    parameters: Parameters
    drawn: DrawnBy
    notes: tuple[str, ...]
    likelihood: Likelihood
    latent: FoundLatent | None = None
    least_noise: float = 0.0
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
