"""Latent posterior and bridge against the exact posterior, over several observations."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.inference.bridge import BridgeResult, Start, bridge
from femupdate.inference.likelihood import LatentLikelihood
from femupdate.inference.smc import TemperedSmc
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.workflow.model import StudyModel

from ..kept_parts import KeptParts
from .case import (
    Case,
    ExactPosterior,
    authors_case,
    data_likelihood,
    exact_posterior,
    random_case,
)
from .comparison import Comparison, compare
from .metrics import MmdReference

PARTICLES = 2000


@dataclass(frozen=True)
class ObservationResult:
    """Both posteriors of one observation.

    Attributes:
        solutions: how many stiffness vectors share its roof response.
        latent, bridged: against the exact posterior.
        evidence_error: log evidence of the bridge less the exact one.
        evidence_sd: the standard error that the bridge gives.
        effective_share: of the bridge's importance draws.
        tempered: whether the bridge had to temper.
        latent_evaluations: of the latent likelihood.
        latent_responses: of the building that the latent likelihood took.
        responses: of the bridge.
        latent_seconds, bridge_seconds: of each.
    """

    solutions: int
    latent: Comparison
    bridged: Comparison
    evidence_error: float
    evidence_sd: float
    effective_share: float
    tempered: bool
    latent_evaluations: int
    latent_responses: int
    responses: int
    latent_seconds: float
    bridge_seconds: float


def observation_results(
    model: StudyModel,
    surrogate: TrainedSurrogate,
    authors: ExactPosterior,
    count: int,
    seed: int,
    advance: Callable[[], None],
    *,
    reference_draws: int = 20_000,
    kept: KeptParts,
) -> list[ObservationResult]:
    """The authors' observation, whose exact posterior is given, and random ones.

    Results that are kept are not made again.
    """
    rng = np.random.default_rng(seed)
    results = []
    for number in range(count):
        case = random_case(model, rng) if number else authors_case(model)

        def result(
            case: Case = case, own: int = seed + number, first: bool = not number
        ) -> ObservationResult:
            exact = authors if first else exact_posterior(model, case, reference_draws, own)
            return _result(model, surrogate, case, exact, own)

        results.append(kept(f"observation {number}", result, result_back))
        advance()
    return results


def result_back(content: dict[str, Any]) -> ObservationResult:
    """A result from its plain content."""
    parts: dict[str, Any] = {}
    for which in ("latent", "bridged"):
        own: dict[str, Any] = {
            k: np.array(v) if isinstance(v, list) else v for k, v in content[which].items()
        }
        parts[which] = Comparison(**own)
    return ObservationResult(**{**content, **parts})


def _result(
    model: StudyModel, surrogate: TrainedSurrogate, case: Case, exact: ExactPosterior, seed: int
) -> ObservationResult:
    reference = MmdReference(exact.theta[:20_000])
    started = time.monotonic()
    latent = LatentLikelihood(surrogate, model.reduced, model.law, case.observation)
    start = TemperedSmc(model.prior, latent).run(PARTICLES, seed)
    middle = time.monotonic()
    found: BridgeResult = bridge(
        model.prior, data_likelihood(model, case), Start(start, latent), seed
    )
    ended = time.monotonic()
    return ObservationResult(
        len(case.solutions),
        compare(case, exact, reference, start.theta.numpy(), seed=seed),
        compare(case, exact, reference, found.theta.numpy(), seed=seed),
        found.log_evidence - exact.weighted.log_evidence,
        found.log_evidence_error,
        found.effective_share,
        found.tempered,
        start.evaluations,
        latent.found.responses,
        found.evaluations,
        middle - started,
        ended - middle,
    )


def summary_rows(results: Sequence[ObservationResult]) -> list[tuple[str, ...]]:
    """What is asked of each figure, with its median and its worst over the observations."""

    def pair(values: ArrayLike, style: str) -> str:
        numbers = np.asarray(values, dtype=float)
        return f"{np.nanmedian(numbers):{style}} ({np.nanmax(numbers):{style}})"

    columns = []
    for which in ("latent", "bridged"):
        parts: list[Comparison] = [getattr(result, which) for result in results]
        ratios = np.concatenate([part.sd_ratio.ravel() for part in parts])
        shifts = np.concatenate([np.abs(part.mean_shift).ravel() for part in parts])
        many = [p.weight_distance for p, r in zip(parts, results, strict=True) if r.solutions > 1]
        columns.append(
            (
                f"{np.nanquantile(ratios, 0.05):.2f} to {np.nanquantile(ratios, 0.95):.2f}",
                pair(shifts, ".2f"),
                pair(many or [np.nan], ".3f"),
                pair([part.c2st for part in parts], ".3f"),
                pair([part.mmd for part in parts], ".3f"),
            )
        )
    names = (
        "sd inside each mode / exact, 5 to 95 %",
        "shift of a mode's mean in exact sd",
        "mode weights, total variation (cases with several modes)",
        "C2ST",
        "MMD to exact",
    )
    wanted = (
        (".8 to 1.5", "-", "<= .05", "<= .70", "<= .04"),
        (".95 to 1.10", "-", "<= .02", "<= .55", "<= .02"),
    )
    return list(zip(names, *columns, *wanted, strict=True))
