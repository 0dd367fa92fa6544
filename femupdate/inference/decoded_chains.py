"""The latent posterior of dozens of factors: chains on the decoder, put right as they go.

Maxima of the decoder's posterior are searched for, chains of Hamiltonian Monte Carlo run from
them, the building answers at some of their states, and the decoder is corrected by what it says;
then again, from where the chains are, until the last correction gives the posterior.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from femupdate.inference.decoded import DecodedLikelihood
from femupdate.inference.hamiltonian import (
    HamiltonianResult,
    HamiltonianSettings,
    hamiltonian_draws,
)
from femupdate.inference.laplace import LaplaceSettings, LaplaceStart, laplace_start
from femupdate.inference.prior import UniformPrior

Respond = Callable[[Tensor], Tensor]
"""The building's ln|H| (n, f, k), of all floors of the decoder, at parameters (n, p)."""


@dataclass(frozen=True)
class DecodedSettings:
    """How the posterior is found.

    Attributes:
        search: of the maxima.
        chains: that run side by side.
        corrections: of the decoder, at least one.
        between: states of each chain before a correction, at each of which the building answers; a
            correction is fitted to those of the last two turns.
        chain: of the chains; those between corrections warm up for half as long.
    """

    search: LaplaceSettings = field(default_factory=LaplaceSettings)
    chains: int = 16
    corrections: int = 3
    between: int = 16
    chain: HamiltonianSettings = field(default_factory=lambda: HamiltonianSettings(rows=64))

    def trajectories(self, draws: int) -> int:
        """In all, for progress."""
        tuning = self.corrections * (self.chain.warm_up // 2 + self.between)
        return tuning + self.chain.warm_up + draws


@dataclass(frozen=True)
class DecodedPosterior:
    """Draws of the latent posterior, and what they took.

    Attributes:
        draws: of chains.
        likelihood: that they were drawn for.
        reached: searches that ended at each maximum that counted at first.
        responses: of the building.
        misfit: mean squared misfit of the building's responses, whitened by the noise, at the state
            that fits best: about one.
        decoder_error: rms by which the decoder, not corrected, missed the last responses.
        error: the same for what was drawn from last, which had not seen them.
    """

    draws: HamiltonianResult
    likelihood: DecodedLikelihood
    reached: tuple[int, ...]
    responses: int
    misfit: float
    decoder_error: float
    error: float


def decoded_posterior(
    prior: UniformPrior,
    likelihood: DecodedLikelihood,
    respond: Respond,
    draws: int,
    seed: int,
    settings: DecodedSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> DecodedPosterior:
    """Draw the latent posterior with so many states of each chain.

    Args:
        prior: of the parameters, with the damping ratio last where it is unknown.
        likelihood: of the decoder as it was trained.
        respond: see `Respond`.
        draws: kept states of each chain.
        seed: of everything random.
        settings: see `DecodedSettings`.
        progress: called with the number of trajectories done since the last call.

    Raises:
        InferenceError: no candidate has a finite likelihood.
    """
    chosen = settings or DecodedSettings()
    first = laplace_start(prior, likelihood.precise().residuals, seed, chosen.search)
    tuned = _tuned(prior, likelihood, respond, first, chosen, seed, progress)
    final = hamiltonian_draws(
        prior,
        tuned.likelihood,
        tuned.start,
        chosen.chains,
        draws,
        seed + chosen.corrections,
        chosen.chain,
        progress,
    )
    return DecodedPosterior(
        final,
        tuned.likelihood,
        first.reached,
        chosen.corrections * chosen.chains * chosen.between,
        float(likelihood.misfit(tuned.answers).min()),
        _rms(likelihood.missed(tuned.states, tuned.answers)),
        tuned.error,
    )


@dataclass(frozen=True)
class _Tuned:
    """A corrected likelihood, its maxima, the last states (n, p), the building's ln|H| there, and
    the rms by which the likelihood before missed it."""

    likelihood: DecodedLikelihood
    start: LaplaceStart
    states: Tensor
    answers: Tensor
    error: float


def _tuned(
    prior: UniformPrior,
    plain: DecodedLikelihood,
    respond: Respond,
    start: LaplaceStart,
    settings: DecodedSettings,
    seed: int,
    progress: Callable[[int], None] | None,
) -> _Tuned:
    """Correct the decoder as often as the settings say."""
    short = replace(settings.chain, warm_up=settings.chain.warm_up // 2)
    chains, between = settings.chains, settings.between
    likelihood, turns = plain, list[tuple[Tensor, Tensor]]()
    error = float("nan")
    for turn in range(settings.corrections):
        found = hamiltonian_draws(
            prior, likelihood, start, chains, between, seed + turn, short, progress
        )
        states = found.theta.flatten(0, 1)
        turns.append((states, respond(states)))
        error = _rms(likelihood.missed(*turns[-1]))
        likelihood = plain.corrected(*(torch.cat(parts) for parts in zip(*turns[-2:], strict=True)))
        # Maxima have moved: the chains are near them.
        start = laplace_start(
            prior,
            likelihood.precise().residuals,
            seed,
            settings.search,
            near=found.theta[:, -1],
        )
    return _Tuned(likelihood, start, *turns[-1], error)


def _rms(values: Tensor) -> float:
    return float(values.square().mean().sqrt())
