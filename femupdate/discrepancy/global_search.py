"""Effects so large that theta without them lies far off, looked for over the whole prior.

No step from there leads to where the right effect would explain the data. Responses with one
effect more at draws of the prior say which are worth a search; noise is taken as coarse, so that
peaks that do not meet yet show their distance.
"""

from collections.abc import Iterator, Sequence
from functools import partial

import torch
from torch import Tensor

from femupdate.discrepancy.fit import (
    Fit,
    coarse,
    fit,
    misfits,
    prior_draws,
)
from femupdate.discrepancy.score import Score
from femupdate.discrepancy.thresholds import FIT, SEARCH
from femupdate.effects.effect import Placed
from femupdate.inference.likelihood import Likelihood
from femupdate.seeds import spawn, torch_generator
from femupdate.workers import in_threads


def global_fit(
    problem: Likelihood,
    base: Fit,
    scores: Sequence[Score],
    leading: Sequence[Placed],
    seed: int = 0,
) -> Fit | None:
    """A rough fit with one effect more that explains most of what the model leaves.

    Args:
        problem: the likelihood of the data.
        base: the model so far, fitted.
        scores: tests of every effect, the strongest first.
        leading: what explains most near the base.
        seed: of the draws.

    Returns:
        The best fit as if noise were coarse, or None where no effect explains half.
    """
    rough = coarse(problem)
    alone = fit(rough, base.placed, base.z, 10)
    most = _most(problem, scores, leading)

    def screened(placed: Placed) -> tuple[float, tuple[Placed, ...], Tensor]:
        together = (*base.placed, placed)
        drawn = _draws if placed.label in most else _own
        z = drawn(rough, alone, together, seed)
        misfit = misfits(rough.with_effects(together), z)
        nearest = misfit.sort()
        return float(nearest.values[0]), together, z[nearest.indices[: SEARCH.starts]]

    others = [one.placed for one in scores if not one.placed.exchange]
    first = sorted(in_threads(screened, others), key=lambda one: one[0])[: SEARCH.searched]
    begun = [(together, start) for _, together, starts in first for start in starts]
    fits = in_threads(lambda one: fit(rough, *one, FIT.steps), begun)
    best = min(fits, key=lambda one: one.misfit, default=alone)
    if best.chi2 > SEARCH.better * alone.chi2:
        best = min([best, *_of_usual_size(rough, alone, scores)], key=lambda one: one.misfit)
    if best.chi2 > SEARCH.better * alone.chi2:
        return None
    return min(best, *_everywhere(rough, best, seed), key=lambda one: one.misfit)


def _of_usual_size(problem: Likelihood, alone: Fit, scores: Sequence[Score]) -> list[Fit]:
    """Fits from theta as it is with every effect by itself, a prior's deviation large.

    Where damping is low a draw of the prior seldom meets the peaks; steps lead there.
    """
    starts = [
        one
        for placed in (score.placed for score in scores if score.placed.effect.parameters)
        for one in _either_sign(problem, alone, placed)
    ]
    begun = in_threads(lambda one: fit(problem, *one, FIT.first_steps), starts)
    begun.sort(key=lambda one: one.misfit)
    leading = {one.placed[-1].label: one for one in reversed(begun)}
    chosen = sorted(leading.values(), key=lambda one: one.misfit)[: SEARCH.searched]
    return in_threads(lambda one: fit(problem, one.placed, one.z, FIT.steps), chosen)


def _either_sign(
    problem: Likelihood, alone: Fit, placed: Placed
) -> Iterator[tuple[tuple[Placed, ...], Tensor]]:
    """An effect with its first parameter a deviation of its prior to either side, if it can be."""
    together, own = (*alone.placed, placed), len(placed.effect.parameters)
    where = problem.with_effects(together).prior.steps
    for size in (-1.0, 1.0):
        start = torch.cat([alone.z, alone.z.new_zeros(own)])
        start[-own] = size
        start = where.inside(start)
        if float(start[-own]) * size > 0.0:
            yield together, start


def _everywhere(problem: Likelihood, found: Fit, seed: int) -> list[Fit]:
    """Fits with the effect that was found, from the best of many draws of theta."""
    own, sizes = found.likelihood, found.z[found.steps.first_size :]
    z = prior_draws(own, sizes, SEARCH.many_draws, spawn(seed, 1)[0])
    nearest = misfits(own, z).argsort()[: SEARCH.many_starts]
    followed = partial(fit, own, found.placed, iterations=FIT.steps)
    return in_threads(followed, z[nearest])


def _most(problem: Likelihood, scores: Sequence[Score], leading: Sequence[Placed]) -> set[str]:
    """Labels of what gets all draws: what leads, and the strongest place of every effect."""
    if problem.reduced.model.size <= SEARCH.cheap:
        return {one.placed.label for one in scores}
    chosen = {one.effect.name: one.label for one in reversed([one.placed for one in scores])}
    return {*chosen.values(), *(one.label for one in leading[: SEARCH.leading])}


def _draws(problem: Likelihood, alone: Fit, together: tuple[Placed, ...], seed: int) -> Tensor:
    """Unknowns (n, d) with the last effect: half from the prior, half of theta as it is but for one
    story, the effect's parameters from their prior."""
    drawn, half = _from_prior(problem, alone, together, SEARCH.draws, seed), SEARCH.draws // 2
    stories = torch.arange(half) % alone.steps.stories
    return torch.cat([_one_story(alone, drawn[:half], stories), drawn[half:]])


def _own(problem: Likelihood, alone: Fit, together: tuple[Placed, ...], seed: int) -> Tensor:
    """Unknowns (n, d) with theta as it is but for the story in which the last effect sits."""
    drawn = _from_prior(problem, alone, together, SEARCH.few_draws, seed)
    story = _story(problem, together[-1].place)
    stories = torch.arange(SEARCH.few_draws) % alone.steps.stories
    return _one_story(
        alone, drawn, stories if story is None else torch.full((SEARCH.few_draws,), story)
    )


def _story(problem: Likelihood, place: str) -> int | None:
    """The story that a place, such as "S2", "X1/S2" or "3F", lies in; None for another place."""
    structure, last = problem.reduced.structure, place.split("/")[-1]
    for names in (structure.building.story_names, structure.floors):
        if last in names:
            return names.index(last)
    return None


def _from_prior(
    problem: Likelihood, alone: Fit, together: tuple[Placed, ...], count: int, seed: int
) -> Tensor:
    """Unknowns (count, d) with theta, zeta and the last effect from their priors."""
    where = problem.with_effects(together).prior.steps
    known = alone.z[alone.steps.first_size :]
    own = len(together[-1].effect.parameters)
    stories, sizes = spawn(seed, 3)[1:]
    sizes_of = torch.cat([known, known.new_zeros(own)])
    drawn = prior_draws(problem.with_effects(together), sizes_of, count, stories)
    generator = torch_generator(sizes)
    size = torch.randn(count, own, generator=generator, dtype=torch.float64)
    drawn[:, -own:] = SEARCH.wider * size
    return where.inside(drawn)


def _one_story(alone: Fit, drawn: Tensor, stories: Tensor) -> Tensor:
    """Draws whose stiffness factors, but for one story each, and damping are those of a fit."""
    rows, first = torch.arange(len(drawn)), alone.steps.first_size
    near = drawn.clone()
    near[:, :first] = alone.z[:first]
    near[rows, stories] = drawn[rows, stories]
    return near


__all__ = ["global_fit"]
