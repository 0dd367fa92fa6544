"""From particles of an easier posterior to precise draws from the one wanted.

Importance sampling from a mixture fitted to the particles is tried first: it costs a few thousand
likelihoods. Where too few of its draws count, the particles are first brought over by tempering.
"""

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
from femupdate.inference.sampler_run import SamplerRun
from femupdate.inference.smc import LogLikelihood, SmcSettings, TemperedSmc
from femupdate.inference.thresholds import DRAWS
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, spawn


@dataclass(frozen=True)
class Start:
    """What a bridge starts from.

    Attributes:
        run: particles and evidence of the base.
        base: log likelihood that they were drawn for; None where they are of the target itself.
    """

    run: SamplerRun
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
) -> SamplerRun:
    """Return as many draws from the target as `start` has particles, with its levels.

    Where importance sampling does not work they are tempered particles, without an effective size.

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
    begun = drawn = start.run
    count = len(begun.theta)
    wanted = 4 * count  # importance draws
    weighted = _tried(prior, counted, begun.theta, wanted, first, importance)
    if weighted is None and start.base is not None:
        tempering = TemperedSmc(prior, counted, base=start.base, settings=settings)
        drawn = tempering.run(count, between, start=begun.theta)
        drawn = replace(drawn, log_evidence=drawn.log_evidence + begun.log_evidence)
        weighted = _tried(prior, counted, drawn.theta, wanted, second, importance)
    if weighted is not None:
        drawn = weighted.resampled(count, chosen)
    return replace(drawn, evaluations=counted.count, levels=begun.levels, invalid=begun.invalid)


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
