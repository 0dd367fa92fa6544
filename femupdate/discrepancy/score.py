"""Rao's score test of every effect at every place, with stiffness and damping projected out.

Each effect costs one response. What theta, zeta and the effects already in the model can absorb
of it is taken out by projection; what is left is compared with the residuals (Rao, 1948).

The projection is along straight lines, which a large step of an effect leaves even where the
factors could follow it exactly (a soft base under a shear building is a soft first story). What
cannot be seen is told after the model without the effect is fitted to what that with it predicts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import torch
from torch import Tensor

from femupdate.discrepancy.fit import DIFFERENCE, Fit, extended
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.tolerances import tolerance_of
from femupdate.inference.likelihood import Likelihood
from femupdate.linear import least_squares
from femupdate.workers import in_threads

_NOTHING = 1e-9  # squared, of what an effect changes


@dataclass(frozen=True, eq=False)
class Score:
    """What one effect at one place could explain.

    Attributes:
        start: its parameters at which the test was made and a fit may start.
        statistic: residuals along what only this effect does, in standard deviations; zero where
            the sign is impossible.
        size: estimate of its first parameter.
        strength: length of what only this effect does, per prior standard deviation of its size:
            the D that it would show.
        absorbed: share (of the squared length) that theta, zeta and the model's effects absorb.
        direction: (n,) unit vector of what only this effect does; None where nothing is left.
    """

    placed: Placed
    start: tuple[float, ...]
    statistic: float
    size: float
    strength: float
    absorbed: float
    direction: Tensor | None


def candidates(problem: Likelihood, present: tuple[Placed, ...] = ()) -> list[Placed]:
    """Every effect at every place that these data could show."""
    return [placed for placed in _not_present(problem, present) if measures(problem, placed)]


def measures(problem: Likelihood, placed: Placed) -> bool:
    """Whether the data could show an effect at its place."""
    there = not placed.effect.instrument or _at_a_sensor(problem, placed)
    return problem.shows(placed.effect) and there


def without_phase(problem: Likelihood, present: tuple[Placed, ...] = ()) -> tuple[str, ...]:
    """Labels of what only phases show, where none were measured."""
    return tuple(
        placed.label
        for placed in _not_present(problem, present)
        if placed.effect.needs_phase and not problem.shows(placed.effect)
        if _at_a_sensor(problem, placed)
    )


def _not_present(problem: Likelihood, present: tuple[Placed, ...]) -> Iterator[Placed]:
    known = {placed.label for placed in present}
    for effect in CATALOGUE.values():
        if not effect.correction:
            everywhere = (Placed(effect, at) for at in effect.places(problem.reduced.structure))
            yield from (placed for placed in everywhere if placed.label not in known)


def _at_a_sensor(problem: Likelihood, placed: Placed) -> bool:
    """Whether something was measured on all floors that the place names."""
    floors, observed = problem.reduced.structure.floors, problem.measured_floors
    return all(part in observed for part in placed.place.split(",") if part in floors)


def score(problem: Likelihood, base: Fit, placed: Placed) -> Score:
    """Test one effect on top of a fitted model; the best of its starting points counts."""
    together, begun = (*base.placed, placed), starts(problem, placed)
    if tolerance_of(placed, base.placed) is not None:
        # What only it does is that it costs nothing, which bends of a large step would hide.
        neutral = placed.effect.parameters[0].neutral
        begun = [(neutral + DIFFERENCE * (size - neutral), *rest) for size, *rest in begun]
    known = (np.concatenate([base.known, start]) for start in begun)
    z = torch.stack([extended(problem, base, together, values) for values in known])
    of = problem.with_effects(together)
    missed = of.raw(of.prior.steps.values(z))
    there = ~missed.isnan().all(dim=1)  # or no structure is left
    changed = torch.full((len(z), len(base.residual)), torch.nan, dtype=z.dtype)
    changed[there] = problem.whitened(missed[there])
    tests = [_score_at(base, placed, *both) for both in zip(begun, changed, strict=True)]
    return max(tests, key=lambda test: abs(test.statistic))


def starts(problem: Likelihood, placed: Placed) -> list[tuple[float, ...]]:
    """Effect parameters to test at: those from which the size is looked for, tunings near every
    mode, what else there is at its neutral value.
    """
    if not placed.effect.parameters:
        return [()]
    size, *others = placed.effect.parameters
    sign = -1.0 if size.upper <= size.neutral else 1.0
    values = [[size.neutral + sign * trial * size.scale for trial in size.trials]]
    # Ratios to the first frequency, over the lower part of the grid. What a tuned mass does is
    # narrow: one of 2.7 % of a floor was missed by twelve ratios and found by forty.
    first = problem.reduced.structure.fundamental[0] / (2.0 * np.pi)
    top = max(1.2, min(0.6 * problem.top_hz / first, 7.0))
    tunings = [float(ratio) for ratio in np.geomspace(0.5, top, 40)]
    values += [tunings if other.tuning else [other.neutral] for other in others]
    return list(product(*values))


def _score_at(base: Fit, placed: Placed, start: tuple[float, ...], changed: Tensor) -> Score:
    """The test at one starting point, with the whitened residuals (m,) there."""
    if bool(changed.isnan().all()):
        return Score(placed, start, 0.0, 0.0, 0.0, 1.0, None)
    effect = base.residual - changed  # change of the prediction
    residual, jacobian = base.residual, base.jacobian
    # What the base knows beforehand, as tolerances, follows an effect only at a cost.
    held = base.steps.precision.diagonal()
    if bool((held > 0.0).any()):
        root = torch.diag(held.sqrt())
        jacobian = torch.cat([jacobian, root])
        residual = torch.cat([residual, root @ (base.steps.mean - base.z)])
        effect = torch.cat([effect, torch.zeros_like(held)])
    alone = effect - jacobian @ least_squares(jacobian, effect)
    whole, left = float(effect @ effect), float(alone @ alone)
    absorbed = 1.0 - left / whole if whole > _NOTHING else 1.0
    if left <= _NOTHING or absorbed > 1.0 - 1e-6:
        return Score(placed, start, 0.0, 0.0, 0.0, 1.0, None)
    unit = alone / left**0.5
    statistic = float(unit @ residual)
    if not start:  # an exchange is there or not
        rest = residual - effect
        gain = float(residual @ residual) - float(rest @ rest)
        worth = float(np.sqrt(max(gain, 0.0)))
        return Score(placed, start, worth, 1.0, left**0.5, absorbed, unit)
    size = placed.effect.parameters[0]
    step = start[0] - size.neutral
    share = statistic / left**0.5
    estimate = size.neutral + step * share
    estimate = float(np.clip(estimate, size.lower, size.upper))
    if estimate == size.neutral:
        statistic = 0.0
    strength = left**0.5 * size.scale / abs(step)
    return Score(placed, start, statistic, estimate, strength, absorbed, unit)


def alike(first: Score, second: Score) -> float:
    """Cosine between what only the first and only the second effect do."""
    if first.direction is None or second.direction is None:
        return 0.0
    return abs(float(first.direction @ second.direction))


def unobservable_effects(
    problem: Likelihood, base: Fit, scores: list[Score], least: float
) -> tuple[str, ...]:
    """Labels of the effects whose strength is below `least` once the model has followed them.

    Args:
        least: strength, the D per prior standard deviation of their size.
    """
    # Up to a third of the change straight lines will do.
    doubtful = [
        test for test in scores if test.strength >= least and test.start and test.absorbed > 0.3
    ]
    faint = set()
    if doubtful:
        target, remains = _follow(problem, base, doubtful)
        left = remains.norm(dim=1) / target.norm(dim=1).clamp_min(1e-12)
        faint = {
            test.placed.label
            for test, share in zip(doubtful, left.tolist(), strict=True)
            if share * test.strength / (1.0 - test.absorbed) ** 0.5 < least
        }
    return tuple(s.placed.label for s in scores if s.strength < least or s.placed.label in faint)


def same_to_sensors(problem: Likelihood, base: Fit, tests: list[Score], cosine: float) -> bool:
    """Whether several effects leave the same once the model has followed each of them.

    Args:
        tests: of them, the first to be compared with all others.
        cosine: between what they leave, from which they count as the same.
    """
    if not all(test.start for test in tests):
        return all(alike(tests[0], other) >= cosine for other in tests[1:])
    left = _follow(problem, base, tests)[1]
    unit = left / left.norm(dim=1, keepdim=True).clamp_min(1e-12)
    return bool(((unit[1:] @ unit[0]).abs() >= cosine).all())


def _follow(problem: Likelihood, base: Fit, tests: list[Score]) -> tuple[Tensor, Tensor]:
    """What each effect changes, and what of it the refitted model does not follow, (t, n)."""

    def change(test: Score) -> Tensor:
        """(n,) change of the whitened prediction by an effect."""
        together = (*base.placed, test.placed)
        neutral = test.placed.effect.parameters[0].neutral
        # A tenth of the test's step: small enough for one Jacobian to serve all rounds.
        size = neutral + 0.1 * (test.start[0] - neutral)
        z = extended(problem, base, together, np.array([*base.known, size, *test.start[1:]]))
        of = problem.with_effects(together)
        return base.residual - of.residuals(of.prior.steps.values(z[None]))[0]

    target = torch.stack(in_threads(change, tests))  # (t, n)
    normal = base.jacobian.T @ base.jacobian
    ridge = 1e-9 * torch.diag(normal.diagonal().clamp_min(1e-12))
    inverse = torch.linalg.pinv(normal + ridge, hermitian=True)
    z = base.z.expand(len(tests), -1).clone()
    remains, moving = target.clone(), torch.arange(len(tests))
    for _ in range(6):
        step = remains[moving] @ base.jacobian @ inverse
        trial = base.steps.inside(z[moving] + step.clamp(-1.0, 1.0))
        followed = base.residual - base.likelihood.residuals(base.steps.values(trial))
        left = target[moving] - followed
        better = left.norm(dim=1) < remains[moving].norm(dim=1)
        moving = moving[better]
        if not len(moving):
            break
        z[moving], remains[moving] = trial[better], left[better]
    return target, remains
