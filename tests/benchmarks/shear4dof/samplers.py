"""The published table of samplers, for two samplers and two likelihoods, with the floor."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.inference.importance import WeightedDraws, importance_draws
from femupdate.inference.smc import PAPER, LogLikelihood, SmcSettings, TemperedSmc
from femupdate.workflow.model import StudyModel

from ..kept_parts import KeptParts
from .case import (
    Case,
    ExactPosterior,
    case_modes,
    data_likelihood,
)
from .metrics import MmdReference, total_variation

SAMPLERS = {"random walk (paper)": PAPER, "mixture": SmcSettings()}

# Table 2 of the paper: particles, evaluations, MMD, its sd over ten runs, seconds on a GPU.
PUBLISHED = (
    ("SMC", 500, 91_000, 0.086, 0.038, 0.8),
    ("SMC", 1000, 182_000, 0.077, 0.034, 0.8),
    ("SMC", 2000, 362_000, 0.051, 0.019, 0.8),
    ("SMC", 4000, 724_000, 0.040, 0.015, 0.8),
    ("NUTS, one chain of 60,000", 0, 558_871, 0.629, 0.159, 1782.0),
)


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation over runs."""

    mean: float
    sd: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Of some values; the sd of one is no number."""
        sd = float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
        return cls(float(np.mean(values)), sd)


@dataclass(frozen=True)
class SamplerRow:
    """Several runs of one sampler with one number of particles.

    Attributes:
        likelihood: "latent" or "data".
        sampler: its name; "independent draws" for the floor.
        particles: a run.
        evaluations: of the likelihood, mean.
        mmd_own: to many draws of the same posterior.
        mmd_exact: to the exact posterior.
        weight_distance: total variation of the mode weights from those of the same posterior.
        log_evidence: of the data likelihood; no number for the latent one, which has none.
        unique: share of different particles at the end, mean.
        seconds: mean.
    """

    likelihood: str
    sampler: str
    particles: int
    evaluations: float
    mmd_own: Spread
    mmd_exact: Spread
    weight_distance: Spread
    log_evidence: Spread
    unique: float
    seconds: float


@dataclass(frozen=True)
class References:
    """What draws of one likelihood are compared with: its own posterior and the exact one."""

    own: MmdReference
    weight: Floats
    exact: MmdReference


def own_posterior(
    model: StudyModel, log_likelihood: LogLikelihood, draws: int, seed: int
) -> WeightedDraws:
    """Importance draws, three for every two wanted, of any likelihood's posterior."""
    found = TemperedSmc(model.prior, log_likelihood).run(min(4000, draws), seed)
    return importance_draws(model.prior, log_likelihood, found.theta, draws + draws // 2, seed + 1)


def sampler_rows(
    model: StudyModel,
    case: Case,
    likelihood: tuple[str, LogLikelihood],
    references: References,
    sizes: Sequence[int],
    runs: int,
    advance: Callable[[], None],
    kept: KeptParts,
) -> list[SamplerRow]:
    """Both samplers at all sizes; rows that are kept are not made again."""
    rows = []
    for name in SAMPLERS:
        for size in sizes:
            make = partial(_row_of_runs, model, case, likelihood, references, (name, size, runs))
            rows.append(kept(f"{likelihood[0]}, {name}, {size}", make, row_back))
            advance()
    return rows


def _row_of_runs(
    model: StudyModel,
    case: Case,
    likelihood: tuple[str, LogLikelihood],
    references: References,
    what: tuple[str, int, int],
) -> SamplerRow:
    """Several runs of one sampler; `what` names it, its particles and the number of runs."""
    label, log_likelihood = likelihood
    name, size, runs = what
    sampler = TemperedSmc(model.prior, log_likelihood, settings=SAMPLERS[name])
    found = []
    for run in range(runs):
        started = time.monotonic()
        result = sampler.run(size, 1000 * size + run)
        seconds = time.monotonic() - started
        theta = result.theta.numpy()
        found.append(
            (
                float(result.evaluations),
                references.own(theta),
                references.exact(theta),
                total_variation(case_modes(case, theta).weight, references.weight),
                result.log_evidence if label == "data" else float("nan"),
                result.levels[-1].unique,
                seconds,
            )
        )
    return _row(label, name, size, found)


def row_back(content: dict[str, Any]) -> SamplerRow:
    """A row from its plain content."""
    parts: dict[str, Any] = {
        k: Spread(**v) if isinstance(v, dict) else v for k, v in content.items()
    }
    return SamplerRow(**parts)


def floor_rows(
    case: Case,
    exact: ExactPosterior,
    fresh: WeightedDraws,
    reference: MmdReference,
    sizes: Sequence[int],
    runs: int,
) -> list[SamplerRow]:
    """Independent draws of the exact posterior, which no sampler can beat but by design.

    Args:
        fresh: other draws than those of the reference.
    """
    draws = fresh.independent(1)[0].numpy()
    rng = np.random.default_rng(2)
    rows = []
    for size in sizes:
        found = []
        for _ in range(runs):
            theta = draws[rng.choice(len(draws), size, replace=len(draws) < size)]
            distance = reference(theta)
            weights = case_modes(case, theta).weight
            far = total_variation(weights, exact.modes.weight)
            found.append((float(size), distance, distance, far, float("nan"), 1.0, float("nan")))
        rows.append(_row("data", "independent draws", size, found))
    return rows


def fresh_exact(model: StudyModel, case: Case, exact: ExactPosterior, seed: int) -> WeightedDraws:
    """Importance draws of the exact posterior that are none of those in `exact`."""
    target = data_likelihood(model, case)
    start = exact.weighted.resample(2000, seed)[0]
    return importance_draws(model.prior, target, start, 20_000, seed + 1)


def _row(
    likelihood: str, sampler: str, particles: int, found: Sequence[tuple[float, ...]]
) -> SamplerRow:
    evaluations, own, exact, distance, evidence, unique, seconds = zip(*found, strict=True)
    return SamplerRow(
        likelihood,
        sampler,
        particles,
        float(np.mean(evaluations)),
        Spread.of(own),
        Spread.of(exact),
        Spread.of(distance),
        Spread.of(evidence),
        float(np.mean(unique)),
        float(np.mean(seconds)),
    )
