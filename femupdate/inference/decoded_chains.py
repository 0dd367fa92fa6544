"""The latent posterior of dozens of factors: a population on the decoder, put right as it goes.

A population goes from the prior to the decoder's posterior, the building answers at some of its
states, and the decoder is corrected by what it says; then again, from where the population is.
Last it moves along the decoder and the building judges every move.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from torch import Tensor

from femupdate.inference.annealed import annealed, annealed_draws
from femupdate.inference.decoded import DecodedLikelihood
from femupdate.inference.delayed_acceptance import CorrectedDraws, corrected_draws
from femupdate.inference.population import AnnealedSettings, Population
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.progress import SILENT, Percent, Progress
from femupdate.seeds import Seed, spawn

Respond = Callable[[Tensor], Tensor]
"""The building's ln|H| (n, f, k), of all floors of the decoder, at parameters (n, p)."""


@dataclass(frozen=True)
class DecodedSettings:
    """How the posterior is found.

    Attributes:
        population: that is carried from the prior.
        corrections: of the decoder, at least one.
        between: states of each particle before a correction, at each of which the building answers;
            a correction is fitted to those of the last two turns.
    """

    population: AnnealedSettings = field(default_factory=AnnealedSettings)
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
        population: that it has drawn.
        responses: of the building.
        misfit: mean squared misfit of the building's responses, whitened by the noise, at the state
            that fits best: about one.
        decoder_error: rms by which the decoder, not corrected, missed the last responses.
        error: the same, corrected by the responses before them.
    """

    draws: CorrectedDraws
    likelihood: DecodedLikelihood
    population: Population
    responses: int
    misfit: float
    decoder_error: float
    error: float


def decoded_posterior(
    prior: UniformPrior,
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
    run = _Run(prior, chosen.population, seed, progress)
    tuned = _tuned(run, likelihood, respond, chosen)

    def dear(parameters: Tensor) -> Tensor:
        return likelihood.by_responses(respond(parameters))

    found = run.draws(tuned.likelihood, dear, tuned.population, draws)
    return DecodedPosterior(
        found,
        tuned.likelihood,
        tuned.population,
        chosen.corrections * len(tuned.states) + found.dear,
        float(likelihood.misfit(tuned.answers).min()),
        _rms(likelihood.missed(tuned.states, tuned.answers)),
        tuned.error,
    )


class _Run:
    """Carries populations, each with a seed of its own, and tells progress."""

    def __init__(
        self,
        prior: UniformPrior,
        settings: AnnealedSettings,
        seed: Seed,
        progress: Progress,
    ) -> None:
        self._prior, self._settings, self._seed, self._progress = prior, settings, seed, progress
        self._stages = 0

    def to(
        self,
        likelihood: DecodedLikelihood,
        start: Population | None = None,
        base: DecodedLikelihood | None = None,
    ) -> Population:
        """From prior times base to prior times likelihood: a stage."""
        told = StageProgress(self._progress)
        return annealed(
            self._prior,
            likelihood,
            self._next_seed(),
            self._settings,
            start=start,
            base=base,
            told=told.power,
        )

    def draws(
        self, cheap: DecodedLikelihood, dear: LogLikelihood, start: Population, count: int
    ) -> CorrectedDraws:
        """So many states: a stage."""
        told = StageProgress(self._progress)
        seed = self._next_seed()
        return corrected_draws(
            self._prior, cheap, dear, start, count, seed, self._settings, told.share
        )

    def states(
        self, likelihood: DecodedLikelihood, start: Population, count: int
    ) -> tuple[Tensor, Population]:
        """Parameters (n, p) for the building to answer at, and where the population is then."""
        seed = self._next_seed()
        found = annealed_draws(self._prior, likelihood, start, count, seed, self._settings)
        return found.theta.flatten(0, 1), found.population

    def _next_seed(self) -> Seed:
        self._stages += 1
        return spawn(self._seed, self._stages)[-1]


class StageProgress:
    """Tells the per cent done of a stage."""

    # Powers grow by about two thirds at a time, from some ten-thousandth.
    _DECADES = 4.0

    def __init__(self, progress: Progress) -> None:
        self._percent = Percent(progress)

    def power(self, beta: float) -> None:
        """The likelihood is raised to beta."""
        self.share(1.0 + max(math.log10(beta) / self._DECADES, -1.0))

    def share(self, done: float) -> None:
        """So much of it is done."""
        self._percent.reached(done)


@dataclass(frozen=True)
class _Tuned:
    """A corrected likelihood, a population that it has drawn, the last states (n, p) before, the
    building's ln|H| there, and the rms by which the likelihood before missed it."""

    likelihood: DecodedLikelihood
    population: Population
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
        count = settings.between * len(population.xi)
        states, population = run.states(likelihood, population, count)
        turns.append((states, respond(states)))
        error = _rms(likelihood.missed(*turns[-1]))
        before = likelihood
        likelihood = plain.corrected(*(torch.cat(parts) for parts in zip(*turns[-2:], strict=True)))
        population = run.to(likelihood, population, before)
    return _Tuned(likelihood, population, *turns[-1], error)


def _rms(values: Tensor) -> float:
    return float(values.square().mean().sqrt())
