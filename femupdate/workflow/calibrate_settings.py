"""How a posterior is sampled, and what a sampler gives."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from femupdate.building.document import Building
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.parameters import Parameters, damping_parameter, theta_prior
from femupdate.inference.posterior import DrawnBy
from femupdate.inference.smc import SmcSettings
from femupdate.inference.tempering import SamplerRun

FEW = 10
"""Parameters up to which particles of the prior find all modes."""


@dataclass(frozen=True)
class CalibrationSettings:
    """How to sample.

    Attributes:
        particles: in all; shared among independent runs.
        exact: data-space likelihood instead of the latent one.
        chains: independent runs, so that their agreement can be judged.
        device: where the likelihood is evaluated.
        anyway: store a posterior even of an observation that is unlike the building.
    """

    particles: int = 5000
    exact: bool = False
    chains: int = 4
    seed: int = 0
    device: str = "cpu"
    anyway: bool = False
    smc: SmcSettings = field(default_factory=SmcSettings)

    @property
    def each(self) -> int:
        """Particles of one run."""
        return max(self.particles // self.chains, 50)


@dataclass(frozen=True)
class Sampled:
    """What a sampler has drawn.

    Attributes:
        parameters: that the columns of their draws are.
        notes: how it went, in sentences.
        likelihood: of what was measured, with the errors of the model that the data show.
        latent: of the latent likelihood, where it was found by a search.
        least_noise: standard deviation of ln|H| below which the likelihood does not believe the
            file's noise.
        warnings: what whoever uses the draws should know, in sentences.
    """

    runs: list[SamplerRun]
    parameters: Parameters
    drawn: DrawnBy
    notes: tuple[str, ...]
    likelihood: Likelihood
    latent: FoundLatent | None = None
    least_noise: float = 0.0
    warnings: tuple[str, ...] = ()


def drawn_by(
    likelihood: str, way: str, runs: Sequence[SamplerRun], *, evidence: bool = True
) -> DrawnBy:
    """What independent runs, one at least, say of how they were drawn.

    The error of their mean evidence is that of their weights; without weights, of their spread.
    """
    known = np.array([run.log_evidence for run in runs])
    weighted = all(run.effective > 0.0 for run in runs)
    error = None
    if weighted:
        error = float(np.linalg.norm([run.log_evidence_error for run in runs]) / len(runs))
    elif len(runs) > 1:
        error = float(known.std(ddof=1) / len(runs) ** 0.5)
    return DrawnBy(
        likelihood=likelihood,
        way=way,
        chains=len(runs),
        evaluations=sum(run.evaluations for run in runs),
        effective_sample_size=sum(run.effective for run in runs) if weighted else None,
        log_evidence=float(logsumexp(known) - np.log(len(known))) if evidence else None,
        log_evidence_error=error if evidence else None,
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


def unserved(building: Building) -> str:
    """Why no surrogate can serve a building, in words; empty where one can."""
    if building.effects:
        return "lists effects"
    count = theta_prior(building).size + damping_parameter(building).free
    return f"has {count} parameters" if count > FEW else ""
