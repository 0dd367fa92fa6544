"""Posteriors of dozens of parameters: populations that Hamiltonian moves carry from the prior.

In dozens of dimensions the posterior of stiffness factors is a thin curved sheet of several parts:
what the data determine well bends along what they leave open. Its highest maxima say little of
where its mass is, and chains that start there stay in their neighbourhood and agree with each
other on it. A population that comes from the prior, with the likelihood raised to growing powers
(Neal 2001, Statistics and Computing 11, 125; Del Moral, Doucet & Jasra 2006, J. R. Statist. Soc. B
68, 411), reaches all parts by their masses. It moves by trajectories of Hamiltonian dynamics (Neal
2011, Handbook of Markov Chain Monte Carlo, ch. 5), which follow the bends.

Several groups share steps and metric but no particles: whether they agree tells how well the
posterior is known.
"""

from collections.abc import Callable
from dataclasses import dataclass

from torch import Tensor

from femupdate.inference.population import AnnealedSettings, Population, Walk, grouped, metric
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.seeds import Seed

Told = Callable[[float], None]
"""Hears of progress: the power of the likelihood, or the share of the draws, that is reached."""


def in_groups(groups: int, rows: int = AnnealedSettings.rows) -> AnnealedSettings:
    """The usual number of particles, in so many groups; not fewer than eight in one."""
    usual = AnnealedSettings()
    each = max(usual.groups * usual.particles // groups, 8)
    return AnnealedSettings(groups=groups, particles=each, rows=rows)


@dataclass(frozen=True)
class AnnealedDraws:
    """States of a population at the whole likelihood.

    Attributes:
        theta: (g, m, p).
        log_likelihood: (g, m).
        log_evidence: (g,).
        acceptance: mean over the kept states.
        gradients: of log likelihoods taken in all.
        population: at the last state.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: Tensor
    acceptance: float
    gradients: int
    population: Population


def annealed(
    prior: UniformPrior,
    target: LogLikelihood,
    seed: Seed,
    settings: AnnealedSettings | None = None,
    *,
    start: Population | None = None,
    base: LogLikelihood | None = None,
    told: Told | None = None,
) -> Population:
    """Carry a population to prior times target.

    Args:
        prior: of the parameters.
        target: log likelihood, differentiable by torch.
        seed: of everything random.
        settings: see `AnnealedSettings`.
        start: drawn from prior times `base`; from the prior where there is none.
        base: log likelihood that the start was drawn with.
        told: see `Told`.

    Raises:
        InferenceError: no particle has a finite likelihood, or too many levels.
    """
    walk = Walk(prior, target, base, settings or AnnealedSettings(), seed)
    state = walk.start(start)
    while state.beta < 1.0:
        walk.check_levels(state.beta)
        state = walk.moved(walk.raised(state))
        if told is not None:
            told(state.beta)
    return walk.population(state, start)


def annealed_draws(
    prior: UniformPrior,
    target: LogLikelihood,
    start: Population,
    draws: int,
    seed: Seed,
    settings: AnnealedSettings | None = None,
    told: Told | None = None,
) -> AnnealedDraws:
    """Draw at least so many states, of all groups together, from prior times target.

    Args:
        prior: of the parameters.
        target: log likelihood that the start is drawn with.
        start: population there.
        draws: to keep in all; every particle gives as many.
        seed: of everything random.
        settings: see `AnnealedSettings`.
        told: see `Told`.
    """
    chosen = settings or AnnealedSettings()
    walk = Walk(prior, target, None, chosen, seed)
    state = walk.settled(walk.at_target(start))
    factor, kept, shares = metric(state.xi, state.target_slope - state.xi), [], []
    turns = -(-draws // len(start.xi))
    for turn in range(turns):
        state, share = walk.trajectory(state, factor)
        kept.append(state)
        shares.append(share)
        if told is not None:
            told((turn + 1) / turns)

    return AnnealedDraws(
        grouped([walk.theta(one.xi) for one in kept], chosen.groups),
        grouped([one.target for one in kept], chosen.groups),
        start.log_evidence,
        sum(shares) / len(shares),
        start.gradients + walk.gradients,
        walk.population(state, start),
    )


__all__ = [
    "AnnealedDraws",
    "Told",
    "annealed",
    "annealed_draws",
    "in_groups",
]
