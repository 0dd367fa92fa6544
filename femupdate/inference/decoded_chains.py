"""The latent posterior of dozens of factors: a population on the decoder, put right as it goes.

A population goes from the prior to the decoder's posterior, the building answers at some of its
states, and the decoder is corrected by what it says; then again, from where the population is.
Last it moves along the decoder and the building judges every move.

What the model errs by is learned on the way: the first population takes much of it for likely, so
that no few points decide, and from each correction on it is what the decoder's maxima show.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.inference.decoded import Decoded
from femupdate.inference.hamiltonian import DelayedAcceptance
from femupdate.inference.learned import settle
from femupdate.inference.likelihood import Likelihood
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

Beside = Callable[[Likelihood, Tensor], Likelihood]
"""A likelihood by all rows, beside errors that many points share about parameters (1, p)."""


@dataclass(frozen=True)
class DecodedSettings:
    """How the posterior is found.

    Attributes:
        population: how it is carried from the prior.
        particles: of it, all groups together.
        corrections: of the decoder, at least one.
        between: states of each particle before a correction, at each of which the building answers;
            a correction is fitted to those of the last two turns.
        starts: states from which the decoder's maxima are sought, those that fit best.
    """

    population: SmcSettings = POPULATION
    particles: int = 128
    corrections: int = 3
    between: int = 2
    starts: int = 2

    @property
    def stages(self) -> int:
        """Whose progress is told: every posterior on the way, and the draws."""
        return self.corrections + 2


@dataclass(frozen=True)
class DecodedPosterior:
    """Draws of the latent posterior, and what they took.

    Attributes:
        draws: of the building's own likelihood, at the noise of the latent one.
        likelihood: that likelihood, by the rows of the table of errors that count.
        along: the decoder's as it was corrected last, by the likeliest of them.
        population: that it has drawn, after its last move.
        responses: of the building, in all.
        states: (n, p) at which the building answered last.
        decoder_error: rms by which the decoder, not corrected, missed the last responses.
        error: the same, corrected by the responses before them.
    """

    draws: KeptDraws
    likelihood: Likelihood
    along: LogLikelihood
    population: SmcState
    responses: int
    states: Tensor
    decoder_error: float
    error: float


def decoded_posterior(
    exact: Likelihood,
    decoder: Decoded,
    draws: int,
    seed: Seed,
    settings: DecodedSettings | None = None,
    progress: Progress = SILENT,
    *,
    power: float = 1.0,
    beside: Beside | None = None,
) -> DecodedPosterior:
    """Draw the latent posterior, at least so many states in all.

    Args:
        exact: the building's own likelihood, by all rows of the table of errors, smooth in the
            parameters.
        decoder: as it was trained.
        draws: states to keep.
        seed: of everything random.
        settings: see `DecodedSettings`.
        progress: advances by 100 a stage.
        power: that likelihoods are raised to.
        beside: errors of the model that many points share, where it has some.

    Raises:
        InferenceError: no particle has a finite likelihood.
    """
    chosen = settings or DecodedSettings()
    run = _Run(exact.prior, chosen, seed, progress)
    tuned = _tuned(run, exact, decoder, chosen, power, beside)
    judging = tuned.exact.with_rows_of(tuned.likelihood)
    along = raised(tuned.likelihood.log_density, power)
    found = run.draws(along, raised(judging, power), tuned.population, draws)
    judged = found.state.evaluations - tuned.population.evaluations
    values, answers = exact.prior.split(tuned.states), tuned.answers
    return DecodedPosterior(
        found,
        judging,
        along,
        tuned.population,
        chosen.corrections * len(tuned.states) + judged,
        tuned.states,
        _rms(decoder.missed(values.theta, values.zeta, answers)),
        tuned.error,
    )


def raised(likelihood: LogLikelihood, power: float) -> LogLikelihood:
    """A likelihood to a power."""

    def log_likelihood(parameters: Tensor) -> Tensor:
        return power * likelihood(parameters)

    return log_likelihood


def _squares(exact: Likelihood, answers: Tensor) -> Tensor:
    """Sum of squared residuals (n,) of the building's responses, by the noise alone."""
    return exact.data[0].compared(answers).square().sum(1)


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
        likelihood: LogLikelihood,
        start: SmcState | None = None,
        base: LogLikelihood | None = None,
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
        self, cheap: LogLikelihood, dear: LogLikelihood, start: SmcState, count: int
    ) -> KeptDraws:
        """So many states of a likelihood that judges the moves along another one: a stage."""
        told = StageProgress(self._progress)
        sampler = self._sampler(dear, cheap, ((DelayedAcceptance(), 3),))
        reached = sampler.reach(sampler.taken_over(start, self._next_seed()))
        return sampler.draws(reached, count, told.share)

    def states(
        self, likelihood: LogLikelihood, start: SmcState, count: int
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
    """How far it has come.

    Attributes:
        exact: the building's likelihood, with errors that are known beforehand.
        likelihood: a corrected decoder's, by the rows that count.
        population: that it has drawn.
        states: (n, p) before that.
        answers: (n, g, k) ln|H| of the building there.
        error: rms by which the decoder before missed these.
    """

    exact: Likelihood
    likelihood: Likelihood
    population: SmcState
    states: Tensor
    answers: Tensor
    error: float


def _tuned(
    run: _Run,
    exact: Likelihood,
    plain: Decoded,
    settings: DecodedSettings,
    power: float,
    beside: Beside | None,
) -> _Tuned:
    """Correct the decoder, and learn what the model errs by, as often as the settings say."""
    decoder, turns = plain, list[tuple[Tensor, Tensor, Tensor]]()
    likelihood = plain.likelihood(exact).at_row(exact.error.start)
    along = raised(likelihood.log_density, power)
    population, error, states = run.to(along), float("nan"), torch.empty(0)
    for _ in range(settings.corrections):
        count = settings.between * len(population.points.xi)
        states, population = run.states(along, population, count)
        turns.append(_answered(exact, states))
        error = _rms(decoder.missed(*turns[-1]))
        decoder = plain.corrected(*(torch.cat(parts) for parts in zip(*turns[-2:], strict=True)))
        best = _squares(exact, turns[-1][2]).argsort()[: settings.starts]
        if beside is not None:
            exact = beside(exact, states[best[:1]])
        found = settle(decoder.precise().likelihood(exact), states[best]).likelihood
        likelihood = decoder.likelihood(exact).with_rows_of(found)
        before, along = along, raised(likelihood.log_density, power)
        population = run.to(along, population, before)
    return _Tuned(exact, likelihood, population, states, turns[-1][2], error)


def _answered(exact: Likelihood, states: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """theta (n, p) and zeta (n,) of states, and the building's ln|H| (n, g, k) there."""
    values, base = exact.prior.split(states), exact.base
    assert base is not None
    answers = base.predicted(exact.system, values.theta, values.zeta, values.sizes)
    return values.theta, values.zeta, answers


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
