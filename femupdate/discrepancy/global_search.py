"""Effects that theta lies far off without, looked for over the whole prior.

No step from there leads to where the right effect would explain the data. Responses with one
effect more at draws of the prior say which are worth a search; noise is taken as coarse, so that
peaks that do not meet yet show their distance.

Channels exchanged or reversed come after the structure: its responses at draws are found once, and
an exchange only orders or turns their rows.
"""

from collections.abc import Sequence
from functools import partial
from itertools import chain

import torch
from torch import Tensor

from femupdate.discrepancy.fit import FAR_STEPS, Fit, coarse, fit, misfits, prior_draws
from femupdate.discrepancy.score import Score
from femupdate.discrepancy.thresholds import VERDICT
from femupdate.effects.effect import Placed
from femupdate.inference.likelihood import Likelihood
from femupdate.seeds import spawn, torch_generator
from femupdate.workers import in_threads

_SEARCHED, _FOLLOWED = 6, 4  # effects that are fitted, and that are so from everywhere
_ROUGH_STEPS = 10


def global_fit(
    problem: Likelihood, base: Fit, scores: Sequence[Score], seed: int = 0
) -> Fit | None:
    """The best fit with one effect more by coarse noise, or None where none explains half."""
    rough = coarse(problem)
    alone = fit(rough, base.placed, base.z, _ROUGH_STEPS)
    cheap = problem.reduced.model.size <= 60
    few = rough if cheap else rough.on_fewer(rough.reduced.model.size // 2)

    def screened(placed: Placed) -> tuple[float, tuple[Placed, ...], Tensor]:
        together = (*base.placed, placed)
        z = _draws(few, alone, together, seed, 192 if cheap else 96)
        nearest = misfits(few.with_effects(together), z).sort()
        return float(nearest.values[0]), together, z[nearest.indices[:2]]

    def by_themselves(z: Tensor) -> list[Fit]:
        """From one place with every effect, along its size."""
        sized = [(*base.placed, test.placed) for test in scores if test.placed.effect.parameters]
        near = in_threads(partial(_along, few, z), sized)
        return in_threads(lambda near: fit(rough, near.placed, near.z), _leaders(near, _SEARCHED))

    whole = [score.placed for score in scores if not score.placed.exchange]
    first = sorted(in_threads(screened, whole), key=lambda begin: begin[0])[:_SEARCHED]
    begun = [(together, start) for _, together, starts in first for start in starts]
    tried = [alone, *in_threads(lambda begin: fit(rough, *begin), begun)]
    if not cheap or min(tried, key=lambda fitted: fitted.misfit).chi2 > 0.5 * alone.chi2:
        tried += by_themselves(alone.z)
    best, *rivals = _leaders(tried, _FOLLOWED)
    if best.chi2 > 0.5 * alone.chi2:
        return None

    def everywhere(near: Fit) -> list[Fit]:
        """From the best of many draws of theta, with the effect as it was found."""
        of, sizes = near.likelihood, near.z[near.steps.first_size :]
        z = prior_draws(of, sizes, 512, spawn(seed, 1)[0])
        return [fit(of, near.placed, start) for start in z[misfits(of, z).argsort()[:6]]]

    # The right effect may lie far from where a walk has led: if one of its rivals brings theta
    # right, it leaves least there.
    followed = [best] if cheap else [near for near in (best, *rivals) if near is not alone]
    best = _leaders([best, *chain.from_iterable(in_threads(everywhere, followed))], 1)[0]
    if cheap or best.chi2 < (1.0 - VERDICT.most) * alone.chi2:
        return best
    return _leaders([best, *by_themselves(best.z[: len(alone.z)])], 1)[0]


def _along(problem: Likelihood, z: Tensor, placed: tuple[Placed, ...]) -> Fit:
    """The best of a walk along the size of the last effect, from none, all else following.

    Where narrow peaks must meet, little is left near the right size alone, and fits from farther
    off stop. In the frame that showed it steps of a sixth of the prior's sd find it, of a quarter
    do not.
    """
    steps, count = problem.with_effects(placed).prior.steps, len(placed[-1].effect.parameters)
    start = fit(problem, placed, torch.cat([z, z.new_zeros(count)]), 0)
    walked = [start]
    for side in (-1.0, 1.0):
        before, now = start.z, start
        for number in range(1, 19):
            ahead = 2.0 * now.z - before
            ahead[-count] = side * number / 6.0
            inside = steps.inside(ahead)
            if inside[-count] != ahead[-count]:
                break
            before, held = now.z, steps.holding(inside[-count:])
            now = fit(problem, placed, inside, 2, held, now.jacobian, renewed=False)
            walked.append(now)
    return min(walked, key=lambda fitted: fitted.misfit)


def _leaders(fits: Sequence[Fit], count: int) -> list[Fit]:
    """The best fits of different effects."""
    ahead = sorted(fits, key=lambda fitted: fitted.misfit)
    best = {fitted.placed: fitted for fitted in reversed(ahead)}
    return sorted(best.values(), key=lambda fitted: fitted.misfit)[:count]


def _draws(
    problem: Likelihood, alone: Fit, together: tuple[Placed, ...], seed: int, count: int
) -> Tensor:
    """Unknowns (count, d) with the last effect, its parameters drawn from their prior.

    Half have theta from the prior too, half theta as it is but for one story after the other.
    """
    of = problem.with_effects(together)
    known, added = alone.z[alone.steps.first_size :], len(together[-1].effect.parameters)
    in_stories, in_sizes = spawn(seed, 3)[1:]
    begun = torch.cat([known, known.new_zeros(added)])
    drawn = prior_draws(of, begun, count, in_stories)
    generator = torch_generator(in_sizes)
    drawn[:, -added:] = 1.5 * torch.randn(count, added, generator=generator, dtype=torch.float64)
    drawn = of.prior.steps.inside(drawn)
    rows, first = torch.arange(count // 2), alone.steps.first_size
    near, stories = drawn[: count // 2].clone(), rows % alone.steps.stories
    near[:, :first] = alone.z[:first]
    near[rows, stories] = drawn[rows, stories]
    return torch.cat([near, drawn[count // 2 :]])


Promise = tuple[float, Placed, Tensor]
"""A model with one exchange more, fitted as if noise were coarse: the share that it leaves of the
squared residuals without it, the exchange, and the unknowns (d,) of the model without it."""


def exchange_fits(
    problem: Likelihood, base: Fit, exchanges: list[Placed], seed: int = 0
) -> list[Fit]:
    """Fits with one exchange more, of those that explain much."""
    promises = promising(problem, base, exchanges, seed)
    return in_threads(
        lambda promise: fit(problem, (*base.placed, promise[1]), promise[2], FAR_STEPS), promises
    )


def promising(
    problem: Likelihood, base: Fit, exchanges: list[Placed], seed: int = 0
) -> list[Promise]:
    """The exchanges with which theta may explain much, the best first.

    Under a wrong name theta may lie far from where the right one puts it. The basis for searching
    is used where the likelihood has one.
    """
    if not exchanges:
        return []
    wide = coarse(problem.for_search())
    # On the basis for searching only some effects of the base can act.
    serves, first = problem.search is None, base.steps.first_size
    kept, columns = list[Placed](), list(range(first))
    for placed in base.placed:
        count = len(placed.effect.parameters)
        if serves or problem.reduced.terms(placed).shapeless:
            kept.append(placed)
            columns += range(first, first + count)
        first += count
    alone = fit(wide, tuple(kept), base.z[columns], _ROUGH_STEPS)
    known = alone.z[alone.steps.first_size :]
    z = torch.cat([alone.z[None], prior_draws(alone.likelihood, known, 384, seed)])

    def squared(batch: Tensor) -> Tensor:
        """Sums of squared residuals (e, N) with each exchange at the unknowns (N, d) without it."""
        values = alone.steps.split(batch)
        squares = torch.zeros(len(exchanges), len(batch), dtype=torch.float64)
        for data in wide.data:
            predicted = data.predicted(alone.system, *values)
            for number, placed in enumerate(exchanges):
                seen = data.read_with(predicted, placed)
                squares[number] += (data.compared(seen) ** 2).sum(dim=1)
        return squares

    misfit = torch.cat(in_threads(squared, z.split(16)), dim=1)
    promises = []
    for number in misfit.amin(dim=1).argsort()[:3].tolist():
        together = (*alone.placed, exchanges[number])
        nearest = z[misfit[number].argsort()[:2]]
        fits = in_threads(partial(fit, wide, together, iterations=_ROUGH_STEPS), nearest)
        best = min(fits, key=lambda fitted: fitted.chi2)
        moved = base.z.clone()
        moved[columns] = best.z
        share = best.chi2 / max(alone.chi2, 1e-12)
        if share < 0.8:
            promises.append((share, exchanges[number], moved))
    return sorted(promises, key=lambda promise: promise[0])
