"""Channels exchanged or reversed: what they explain is looked for over the whole prior.

Under a wrong name theta may lie far from where the right one puts it, so that no search from there
shows what the exchange is worth. Instruments come after the structure: its responses at draws of
the prior are found once, and an exchange only orders or turns their rows. The few that come nearest
are fitted as if noise were coarse, and those that then explain much as it is.
"""

from dataclasses import dataclass
from functools import partial

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, coarse, fit, prior_draws
from femupdate.discrepancy.thresholds import FIT, SEARCH, VERDICT
from femupdate.effects.effect import Placed
from femupdate.inference.likelihood import Likelihood
from femupdate.workers import in_threads

_BATCH = 16


@dataclass(frozen=True, eq=False)
class Promise:
    """A model with one exchange more, fitted as if noise were coarse.

    Attributes:
        placed: the exchange.
        z: (d,) the unknowns of the model without it, as they are with it.
        share: of the squared residuals that the model without it, fitted likewise, leaves.
    """

    placed: Placed
    z: Tensor
    share: float


def exchange_fits(
    problem: Likelihood, base: Fit, exchanges: list[Placed], seed: int = 0
) -> list[Fit]:
    """Fits with one exchange more, of those that explain much.

    Args:
        problem: the likelihood of the data.
        base: the model so far, fitted.
        exchanges: those to be tried.
        seed: of the draws.
    """
    promises = promising(problem, base, exchanges, seed)
    return in_threads(
        lambda one: fit(problem, (*base.placed, one.placed), one.z, FIT.far_steps), promises
    )


def promising(
    problem: Likelihood, base: Fit, exchanges: list[Placed], seed: int = 0
) -> list[Promise]:
    """The exchanges with which theta may explain much, the best first.

    Args:
        problem: structure and data; its basis for searching is used.
        base: the model so far, fitted.
        exchanges: those to be tried.
        seed: of the draws.
    """
    if not exchanges:
        return []
    wide = coarse(problem.for_search())
    kept = _acting(problem, base)
    columns = _columns(base, kept)
    alone = fit(wide, tuple(base.placed[k] for k in kept), base.z[columns], FIT.rough_steps)
    where = alone.steps
    known = alone.z[where.first_size :]
    drawn = prior_draws(alone.likelihood, known, SEARCH.exchange_draws, seed)
    z = torch.cat([alone.z[None], drawn])
    misfit = _misfits(wide, alone, exchanges, z)
    found = []
    for number in misfit.amin(dim=1).argsort()[: SEARCH.exchanges].tolist():
        placed = (*alone.placed, exchanges[number])
        nearest = misfit[number].argsort()[: SEARCH.starts]
        fits = in_threads(partial(fit, wide, placed, iterations=FIT.rough_steps), z[nearest])
        best = min(fits, key=lambda one: one.chi2)
        moved = base.z.clone()
        moved[columns] = best.z
        found.append(Promise(exchanges[number], moved, best.chi2 / max(alone.chi2, 1e-12)))
    return sorted(
        (one for one in found if one.share < VERDICT.better_exchange), key=lambda one: one.share
    )


def _acting(problem: Likelihood, base: Fit) -> list[int]:
    """Which effects of a fit the basis for searching lets act."""
    serves = problem.search is None
    return [
        number
        for number, one in enumerate(base.placed)
        if serves or problem.reduced.terms(one).shapeless
    ]


def _columns(base: Fit, kept: list[int]) -> list[int]:
    """Which unknowns of a fit belong to theta, zeta and some of its effects."""
    first = base.steps.first_size
    columns = list(range(first))
    for number, one in enumerate(base.placed):
        count = len(one.effect.parameters)
        if number in kept:
            columns += range(first, first + count)
        first += count
    return columns


def _misfits(problem: Likelihood, alone: Fit, exchanges: list[Placed], z: Tensor) -> Tensor:
    """Sums of squared residuals (e, N) with each exchange at the unknowns z (N, d) without it."""

    def of_batch(batch: Tensor) -> Tensor:
        values = alone.steps.split(batch)
        own = torch.zeros(len(exchanges), len(batch), dtype=torch.float64)
        for data in problem.data:
            predicted = data.predicted(alone.system, *values)
            for number, one in enumerate(exchanges):
                seen = data.read_with(predicted, one)
                own[number] += (data.compared(seen) ** 2).sum(dim=1)
        return own

    return torch.cat(in_threads(of_batch, z.split(_BATCH)), dim=1)
