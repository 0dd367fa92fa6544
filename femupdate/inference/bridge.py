"""From particles of an easier posterior to precise draws from the one wanted.

Importance sampling from a mixture fitted to the particles is tried first: it costs a few thousand
likelihoods. Where too few of its draws count, the particles are first brought over by tempering.
"""

import math
from dataclasses import dataclass, replace

from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.importance import (
    Counted,
    ImportanceSettings,
    WeightedDraws,
    importance_draws,
)
from femupdate.inference.parameters import Parameters
from femupdate.inference.smc import LogLikelihood, SmcResult, SmcSettings, TemperedSmc
from femupdate.inference.thresholds import DRAWS
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, spawn


@dataclass(frozen=True)
class BridgeResult:
    """Equally weighted draws from prior times target.

    Attributes:
        theta: (n, p).
        log_likelihood: (n,) of the target.
        log_evidence: of the target.
        log_evidence_error: its standard error; NaN where importance sampling did not work.
        effective_share: of the importance draws; 0 where they were not used.
        effective: effective sample size of the importance draws; 0 likewise.
        evaluations: of the target, all in all.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: float
    log_evidence_error: float
    effective_share: float
    effective: float
    evaluations: int


@dataclass(frozen=True)
class Start:
    """What a bridge starts from.

    Attributes:
        result: particles and evidence of the base.
        base: log likelihood that they were drawn for; None where they are of the target itself.
    """

    result: SmcResult
    base: LogLikelihood | None = None


def bridge(
    prior: Parameters,
    target: LogLikelihood,
    start: Start,
    seed: Seed,
    *,
    settings: SmcSettings | None = None,
    importance: ImportanceSettings | None = None,
    progress: Progress = SILENT,
) -> BridgeResult:
    """Return as many draws from the target as `start` has particles.

    Args:
        prior: of both.
        target: log likelihood wanted.
        start: see `Start`; every mode of the target must hold some of its particles.
        seed: of everything random.
        settings: of the tempering, where it is needed.
        importance: how the proposal is fitted.
        progress: advances by one an evaluation of the target's likelihood.

    Raises:
        InferenceError: see `TemperedSmc`.
    """
    counted = Counted(target, progress)
    first, between, second, chosen = spawn(seed, 4)
    count = len(start.result.theta)
    wanted = 4 * count  # importance draws
    weighted = _tried(prior, counted, start.result.theta, wanted, first, importance)
    if weighted is not None:
        return _resampled(weighted, count, chosen, counted.count)
    if start.base is None:
        return _unrefined(start.result, 0.0, counted.count)
    tempering = TemperedSmc(prior, counted, base=start.base, settings=settings)
    result = tempering.run(count, between, start=start.result.theta)
    weighted = _tried(prior, counted, result.theta, wanted, second, importance)
    if weighted is not None:
        return _resampled(weighted, count, chosen, counted.count)
    return _unrefined(result, start.result.log_evidence, counted.count)


def _tried(
    prior: Parameters,
    target: LogLikelihood,
    particles: Tensor,
    draws: int,
    seed: Seed,
    settings: ImportanceSettings | None,
) -> WeightedDraws | None:
    """Importance draws, if enough of them count."""
    try:
        weighted = importance_draws(prior, target, particles, draws, seed, settings)
    except InferenceError:
        return None
    return weighted if weighted.effective > DRAWS.least_share * draws else None


def _resampled(weighted: WeightedDraws, count: int, seed: Seed, evaluations: int) -> BridgeResult:
    theta, value = weighted.resample(count, seed)
    return BridgeResult(
        theta,
        value,
        weighted.log_evidence,
        weighted.log_evidence_error,
        weighted.effective / len(weighted.points),
        weighted.effective,
        evaluations,
    )


def _unrefined(result: SmcResult, base_log_evidence: float, evaluations: int) -> BridgeResult:
    """The tempered particles as they are."""
    evidence = result.log_evidence + base_log_evidence
    return BridgeResult(
        result.theta, result.log_likelihood, evidence, math.nan, 0.0, 0.0, evaluations
    )


def as_smc_result(found: BridgeResult, like: SmcResult) -> SmcResult:
    """The same draws in the form of a sampler's result, with the levels of `like`."""
    return replace(
        like,
        theta=found.theta,
        log_likelihood=found.log_likelihood,
        log_evidence=found.log_evidence,
        evaluations=found.evaluations,
    )
