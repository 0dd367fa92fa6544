"""Effects so large that theta without them lies far off, looked for over the whole prior.

No step from there leads to where the right effect would explain the data. Responses with one
effect more at draws of the prior say which are worth a search; noise is taken as coarse, so that
peaks that do not meet yet show their distance.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from femupdate.discrepancy.fit import (
    Coordinates,
    Fit,
    coarse,
    coordinates,
    evaluate,
    fit,
    prior_draws,
)
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.score import Score
from femupdate.effects.effect import Placed

_DRAWS = 192
_LEADING = 4  # of the effects that were fitted from the base, tried whatever their place
_CHEAP = 60  # shapes up to which every place is tried
_SEARCHED = 6  # effects and places that are fitted
_STARTS = 2  # draws from which each of them is
_BETTER = 0.5  # share of the coarse residuals, squared, that an effect may leave


def far_fit(
    problem: Problem, base: Fit, scores: Sequence[Score], leading: Sequence[Placed], seed: int = 0
) -> Fit | None:
    """A rough fit with one effect more that explains most of what the model leaves.

    Args:
        problem: structure and data.
        base: the model so far, fitted.
        scores: tests of every effect, the strongest first.
        leading: what explains most near the base.
        seed: of the draws.

    Returns:
        The best fit as if noise were coarse, or None where no effect explains half.
    """
    rough = coarse(problem)
    alone = fit(rough, base.placed, base.z, 10)
    screened = []
    for placed in _tried(problem, scores, leading):
        together = (*base.placed, placed)
        z = _draws(rough, alone, together, seed)
        where = coordinates(rough, together)
        misfit = evaluate(rough, rough.system(together), where, z).square().sum(dim=1)
        nearest = misfit.sort()
        screened.append((float(nearest.values[0]), together, z[nearest.indices[:_STARTS]]))
    screened.sort(key=lambda one: one[0])
    fits = [
        fit(rough, together, start, 15)
        for _, together, starts in screened[:_SEARCHED]
        for start in starts
    ]
    best = min(fits, key=lambda one: one.chi2 + one.penalty, default=None)
    return best if best is not None and best.chi2 < _BETTER * alone.chi2 else None


def _tried(problem: Problem, scores: Sequence[Score], leading: Sequence[Placed]) -> list[Placed]:
    """What leads, and the strongest place of every effect, or all; exchanges are sought apart."""
    single = [one.placed for one in scores if not one.placed.exchange]
    if problem.reduced.model.size <= _CHEAP:
        return single
    chosen = [one for one in leading[:_LEADING] if not one.exchange]
    known = {one.effect.name for one in chosen}
    for one in single:
        if one.effect.name not in known:
            known.add(one.effect.name)
            chosen.append(one)
    return chosen


def _draws(problem: Problem, alone: Fit, together: tuple[Placed, ...], seed: int) -> Tensor:
    """Unknowns (n, d) with the last effect: half from the prior, half of theta as it is but for one
    story, the effect's parameters from their prior."""
    where = coordinates(problem, together)
    known = alone.z[alone.coordinates.first_size :]
    own = len(together[-1].effect.parameters)
    drawn = prior_draws(problem, where, torch.cat([known, known.new_zeros(own)]), _DRAWS, seed)
    half = _DRAWS // 2
    drawn[:half] = _one_story(alone, drawn[:half], where)
    generator = torch.Generator().manual_seed(seed + 1)
    size = torch.randn(_DRAWS, own, generator=generator, dtype=torch.float64)
    drawn[:, -own:] = 1.5 * size
    return torch.minimum(torch.maximum(drawn, where.lower), where.upper)


def _one_story(alone: Fit, drawn: Tensor, where: Coordinates) -> Tensor:
    """Draws whose stiffness factors, all but one, and damping ratio are those of a fit."""
    rows = torch.arange(len(drawn))
    near = drawn.clone()
    near[:, : where.first_size] = alone.z[: where.first_size]
    story = rows % where.stories
    near[rows, story] = drawn[rows, story]
    return near


__all__ = ["far_fit"]
