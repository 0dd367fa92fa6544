"""The latent posterior of dozens of factors: a population on the decoder, put right as it goes.

A population goes from the prior to the decoder's posterior, the building answers at some of its
states, and the decoder is corrected by what it says; then again, from where the population is.
Last it moves along the decoder and the building judges every move.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.inference.decoded import DecodedLikelihood
from femupdate.inference.hamiltonian import DelayedAcceptance
from femupdate.inference.moves import Schedule
from femupdate.inference.parameters import Parameters
from femupdate.inference.smc import (
    POPULATION,
    TRAJECTORIES,
    KeptDraws,
    SmcSettings,
    SmcState,
    TemperedSmc,
)
from femupdate.inference.tempering import LogLikelihood
from femupdate.progress import SILENT, Percent, Progress
from femupdate.seeds import Seed, spawn

Respond = Callable[[Tensor], Tensor]
"""The building's ln|H| (n, f, k), of all floors of the decoder, at parameters (n, p)."""


@dataclass(frozen=True)
class DecodedSettings:
    """How the posterior is found.

    Attributes:
        population: how it is carried from the prior.
        particles: of it, all groups together.
        corrections: of the decoder, at least one.
        between: states of each particle before a correction, at each of which the building answers;
            a correction is fitted to those of the last two turns.
    """

    population: SmcSettings = POPULATION
    particles: int = 128
    corrections: int = 3
    between: int = 2

    @property
    def stages(self) -> int:
        """Whose progress is told: every posterior on the way, and the draws."""
        return self.corrections + 2


@dataclass(frozen=True)
class DecodedPosterior:
    """Draws of the latent posterior, and what they took.

    Attributes:
        draws: of the building's own likelihood, at the noise of the latent one.
        likelihood: of the decoder as it was corrected last.
        population: that it has drawn, after its last move.
        responses: of the building, in all.
        misfit: mean squared misfit of the building's responses, whitened by the noise, at the state
            that fits best: about one.
        decoder_error: rms by which the decoder, not corrected, missed the last responses.
        error: the same, corrected by the responses before them.
    """

    draws: KeptDraws
    likelihood: DecodedLikelihood
    population: SmcState
    responses: int
    misfit: float
    decoder_error: float
    error: float


def decoded_posterior(
    prior: Parameters,
    likelihood: DecodedLikelihood,
    respond: Respond,
    draws: int,
    seed: Seed,
    settings: DecodedSettings | None = None,
    progress: Progress = SILENT,
) -> DecodedPosterior:
    """Draw the latent posterior, at least so many states in all.

    Args:
        prior: of the parameters, with the damping ratio last where it is unknown.
        likelihood: of the decoder as it was trained.
        respond: see `Respond`.
        draws: states to keep.
        seed: of everything random.
        settings: see `DecodedSettings`.
        progress: advances by 100 a stage.

    Raises:
        InferenceError: no particle has a finite likelihood.
    """
    chosen = settings or DecodedSettings()
    run = _Run(prior, chosen, seed, progress)
    tuned = _tuned(run, likelihood, respond, chosen)

    def dear(parameters: Tensor) -> Tensor:
        return likelihood.by_responses(respond(parameters))

    found = run.draws(tuned.likelihood, dear, tuned.population, draws)
    judged = found.state.evaluations - tuned.population.evaluations
    return DecodedPosterior(
        found,
        tuned.likelihood,
        tuned.population,
        chosen.corrections * len(tuned.states) + judged,
        float(likelihood.misfit(tuned.answers).min()),
        _rms(likelihood.missed(tuned.states, tuned.answers)),
        tuned.error,
    )


class _Run:
    """Carries populations, each stage with random streams of its own, and tells progress."""

    def __init__(
        self,
        prior: Parameters,
        settings: DecodedSettings,
        seed: Seed,
        progress: Progress,
    ) -> None:
        self._prior, self._settings, self._seed, self._progress = prior, settings, seed, progress
        self._stages = 0

    def to(
        self,
        likelihood: DecodedLikelihood,
        start: SmcState | None = None,
        base: DecodedLikelihood | None = None,
    ) -> SmcState:
        """From prior times base to prior times likelihood: a stage."""
        told = StageProgress(self._progress)
        sampler = self._sampler(likelihood, base)
        if start is None:
            begun = sampler.init(self._settings.particles, self._next_seed())
        else:
            begun = sampler.taken_over(start, self._next_seed())
        return sampler.reach(begun, told.level)

    def draws(
        self, cheap: DecodedLikelihood, dear: LogLikelihood, start: SmcState, count: int
    ) -> KeptDraws:
        """So many states of a likelihood that judges the moves along another one: a stage."""
        told = StageProgress(self._progress)
        sampler = self._sampler(dear, cheap, ((DelayedAcceptance(), 3),))
        reached = sampler.reach(sampler.taken_over(start, self._next_seed()))
        return sampler.draws(reached, count, told.share)

    def states(
        self, likelihood: DecodedLikelihood, start: SmcState, count: int
    ) -> tuple[Tensor, SmcState]:
        """Parameters (n, p) for the building to answer at, and where the population is then."""
        found = self._sampler(likelihood).draws(start, count)
        return found.theta.flatten(0, 1), found.state

    def _sampler(
        self,
        target: LogLikelihood,
        base: LogLikelihood | None = None,
        moves: Schedule = TRAJECTORIES,
    ) -> TemperedSmc:
        return TemperedSmc(self._prior, target, base, self._settings.population, moves)

    def _next_seed(self) -> Seed:
        self._stages += 1
        return spawn(self._seed, self._stages)[-1]


class StageProgress:
    """Tells the per cent done of a stage."""

    # Powers grow by about two thirds at a time, from some ten-thousandth.
    _DECADES = 4.0

    def __init__(self, progress: Progress) -> None:
        self._percent = Percent(progress)

    def level(self, state: SmcState) -> None:
        """A level is reached."""
        self.share(1.0 + max(math.log10(state.beta) / self._DECADES, -1.0))

    def share(self, done: float) -> None:
        """So much of it is done."""
        self._percent.reached(done)


@dataclass(frozen=True)
class _Tuned:
    """A corrected likelihood, a population that it has drawn, the last states (n, p) before, the
    building's ln|H| there, and the rms by which the likelihood before missed it."""

    likelihood: DecodedLikelihood
    population: SmcState
    states: Tensor
    answers: Tensor
    error: float


def _tuned(
    run: _Run, plain: DecodedLikelihood, respond: Respond, settings: DecodedSettings
) -> _Tuned:
    """Correct the decoder as often as the settings say."""
    likelihood, turns = plain, list[tuple[Tensor, Tensor]]()
    population, error = run.to(plain), float("nan")
    for _ in range(settings.corrections):
        count = settings.between * len(population.points.xi)
        states, population = run.states(likelihood, population, count)
        turns.append((states, respond(states)))
        error = _rms(likelihood.missed(*turns[-1]))
        before = likelihood
        likelihood = plain.corrected(*(torch.cat(parts) for parts in zip(*turns[-2:], strict=True)))
        population = run.to(likelihood, population, before)
    return _Tuned(likelihood, population, *turns[-1], error)


def in_groups(groups: int, rows: int = 128) -> DecodedSettings:
    """The usual number of particles, in so many groups; not fewer than eight in one."""
    usual = DecodedSettings()
    each = max(usual.particles // groups, 8)
    return replace(
        usual,
        population=replace(usual.population, groups=groups, rows=rows),
        particles=groups * each,
    )


def _rms(values: Tensor) -> float:
    return float(values.square().mean().sqrt())
