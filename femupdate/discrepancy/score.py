"""Rao's score test of every effect at every place, with stiffness and damping projected out.

Each effect costs one response. What theta, zeta and the effects already in the model can absorb
of it is taken out by projection; what is left is compared with the residuals (Rao, 1948).
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, extended
from femupdate.discrepancy.thresholds import FIT, FOLLOW
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.inference.likelihood import Likelihood
from femupdate.linear import least_squares


@dataclass(frozen=True, eq=False)
class Score:
    """What one effect at one place could explain.

    Attributes:
        placed: the effect.
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
    structure = problem.reduced.structure
    observed = set(problem.measured_floors)
    known = {one.label for one in present}
    found = []
    for effect in CATALOGUE.values():
        if effect.correction or not problem.shows(effect):
            continue
        for place in effect.places(structure):
            placed = Placed(effect, place)
            unseen = effect.instrument and not _seen(place, observed, structure.floors)
            if placed.label not in known and not unseen:
                found.append(placed)
    return found


def without_phase(problem: Likelihood, present: tuple[Placed, ...] = ()) -> tuple[str, ...]:
    """Labels of what only phases show, where none were measured."""
    observed, known = set(problem.measured_floors), {one.label for one in present}
    structure, found = problem.reduced.structure, []
    for effect in CATALOGUE.values():
        if effect.needs_phase and not problem.shows(effect) and not effect.correction:
            places = (p for p in effect.places(structure) if _seen(p, observed, structure.floors))
            found += [Placed(effect, place).label for place in places]
    return tuple(label for label in found if label not in known)


def _seen(place: str, observed: set[str], floors: tuple[str, ...]) -> bool:
    """Whether an instrument stands where something was measured."""
    named = [part for part in place.split(",") if part in floors]
    return all(part in observed for part in named)


def score(problem: Likelihood, base: Fit, placed: Placed) -> Score:
    """Test one effect on top of a fitted model; the best of its starting points counts."""
    together, begun = (*base.placed, placed), starts(problem, placed)
    z = torch.stack(
        [extended(problem, base, together, np.concatenate([base.known, one])) for one in begun]
    )
    own = problem.with_effects(together)
    missed = own.raw(own.prior.steps.values(z))
    there = ~missed.isnan().all(dim=1)  # or no structure is left
    changed = torch.full((len(z), len(base.residual)), torch.nan, dtype=z.dtype)
    changed[there] = problem.whitened(missed[there])
    tests = [_score_at(base, placed, *one) for one in zip(begun, changed, strict=True)]
    return max(tests, key=lambda one: abs(one.statistic))


def starts(problem: Likelihood, placed: Placed) -> list[tuple[float, ...]]:
    """Effect parameters to test at: those from which the size is looked for, tunings near every
    mode, what else there is at its neutral value.
    """
    own = placed.effect.parameters
    if not own:
        return [()]
    size = own[0]
    sign = -1.0 if size.upper <= size.neutral else 1.0
    values = [[size.neutral + sign * trial * size.scale for trial in size.trials]]
    values += [_tunings(problem) if other.tuning else [other.neutral] for other in own[1:]]
    return list(product(*values))


def _tunings(problem: Likelihood) -> list[float]:
    """Ratios to the first frequency around the lower half of the grid."""
    low, high = FIT.tuned
    first = problem.reduced.structure.fundamental[0] / (2.0 * np.pi)
    top = FIT.tuned_top * problem.top_hz / first
    return [float(r) for r in np.geomspace(low, max(1.2, min(top, high)), FIT.tunings)]


def _score_at(base: Fit, placed: Placed, start: tuple[float, ...], changed: Tensor) -> Score:
    """The test at one starting point, with the whitened residuals (m,) there."""
    if bool(changed.isnan().all()):
        return Score(placed, start, 0.0, 0.0, 0.0, 1.0, None)
    effect = base.residual - changed  # change of the prediction
    residual, jacobian = base.residual, base.jacobian
    own = effect - jacobian @ least_squares(jacobian, effect)
    whole, left = float(effect @ effect), float(own @ own)
    absorbed = 1.0 - left / whole if whole > FOLLOW.nothing else 1.0
    if left <= FOLLOW.nothing or absorbed > 1.0 - 1e-6:
        return Score(placed, start, 0.0, 0.0, 0.0, 1.0, None)
    unit = own / left**0.5
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
    if not size.lower <= estimate <= size.upper:
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
