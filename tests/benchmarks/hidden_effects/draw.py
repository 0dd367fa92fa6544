"""What a trial draws: parameters of the building, and effects with their places and sizes."""

from collections.abc import Callable

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.effects import CATALOGUE, Effect, Placed
from femupdate.effects.structure import Structure
from femupdate.inference.parameters import damping_parameter, theta_prior

from .measurement import HiddenEffect
from .uncatalogued import UNCATALOGUED

CLEAN, ONE, TWO, OUTSIDE = "clean", "one", "two", "outside"
KINDS = (CLEAN, ONE, TWO, OUTSIDE)
# Sampled in their own step of the pipeline, or not to be made in a time history.
_NOT_HIDDEN = ("noise_floor",)
_SIZES = (0.3, 2.5)  # times the prior's standard deviation


def draw_parameters(building: Building, rng: np.random.Generator) -> tuple[Floats, float]:
    """Stiffness factors in the inner part of the prior, and a damping ratio."""
    prior = theta_prior(building)
    low, high = prior.lower.numpy() * 1.5, prior.upper.numpy() / 1.5
    theta = np.exp(rng.uniform(np.log(low), np.log(high)))
    damping = damping_parameter(building)
    if not damping.free:
        return theta, damping.lower
    return theta, float(np.exp(rng.uniform(np.log(max(damping.lower, 0.005)), np.log(0.03))))


def draw_effects(
    kind: str,
    building: Building,
    structure: Structure,
    shows: Callable[[Effect], bool],
    rng: np.random.Generator,
) -> tuple[HiddenEffect, ...]:
    """Effects of a trial: each that the data show is equally likely, then every place of it."""
    if kind == CLEAN:
        return ()
    pool: list[Effect] = [
        effect
        for effect in (UNCATALOGUED if kind == OUTSIDE else CATALOGUE.values())
        if effect.name not in _NOT_HIDDEN
        and not effect.needs_levels
        and effect.places(structure)
        and shows(effect)
    ]
    chosen = rng.choice(len(pool), size=2 if kind == TWO else 1, replace=False)
    hidden = []
    for effect in (pool[index] for index in chosen):
        places = effect.places(structure)
        place = places[rng.integers(len(places))]
        hidden.append((Placed(effect, place), _values(effect, structure, building, rng)))
    return tuple(hidden)


def _values(
    effect: Effect, structure: Structure, building: Building, rng: np.random.Generator
) -> tuple[float, ...]:
    if not effect.parameters:
        return ()
    size, *others = effect.parameters
    amount = size.scale * np.exp(rng.uniform(*np.log(_SIZES)))
    negative = size.upper <= size.neutral or (size.lower < size.neutral and rng.random() < 0.3)
    value = float(np.clip(size.neutral + (-amount if negative else amount), size.lower, size.upper))
    # An appendage is tuned somewhere in the lower half of the grid.
    first = structure.fundamental[0] / (2.0 * np.pi)
    highest = min(0.5 * building.frequency_grid.stop / first, 6.0)
    rest = (
        float(np.exp(rng.uniform(0.0, np.log(highest))))
        if other.tuning
        else float(np.clip(rng.normal(other.neutral, other.scale), other.lower, other.upper))
        for other in others
    )
    return (value, *rest)
