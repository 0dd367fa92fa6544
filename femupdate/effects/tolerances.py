"""What is known to a tolerance alone: effects on every floor with priors as narrow as it is."""

from dataclasses import replace
from functools import lru_cache

from femupdate.building.common import Tolerances
from femupdate.building.document import Building
from femupdate.effects.catalogue.added_mass import AddedMass
from femupdate.effects.catalogue.channels import BaseGain, ChannelDelay, ChannelGain
from femupdate.effects.effect import Effect, Placed

TOLERANCES = {"mass": "masses", "gain": "gains", "delay": "clocks"}
"""Keys of a building's tolerances, each with what it is of in words."""

USUAL = Tolerances.model_construct(mass=0.015, gain=0.005, delay=0.0005)
"""What a name must go beyond where a building states no tolerances; state 0 where all is exact.

Concrete's density scatters by 4 %, most of it alike in one building (JCSS Probabilistic Model Code,
part 2.1, 2001); sensors are calibrated to .5 %, and sampled together to half a millisecond.
"""


def tolerances_of(building: Building, unstated: Tolerances | None = None) -> tuple[Placed, ...]:
    """What a building's tolerances let vary: masses and channels of every floor.

    Args:
        unstated: those of a building that states none; by default nothing varies.
    """
    stated = building.tolerances or unstated
    if stated is None:
        return ()
    floors = building.floors
    varying = (
        (AddedMass, "mass", stated.mass, floors),
        (BaseGain, "gain", stated.gain, ("base",)),
        (ChannelGain, "gain", stated.gain, floors),
        (ChannelDelay, "delay", stated.delay, floors),
    )
    return tuple(
        Placed(_known_to(kind, key, sd), place)
        for kind, key, sd, places in varying
        for place in places
        if sd
    )


def key_of(name: str) -> str:
    """The tolerance that a parameter such as "mass_tolerance@3F.size" is of; empty for others."""
    key, found, _ = name.partition("_tolerance@")
    return key if found else ""


@lru_cache
def _known_to(kind: type[Effect], key: str, sd: float) -> Effect:
    """An effect of the catalogue whose size is known: zero, and the tolerance about it."""
    size = replace(kind.parameters[0], scale=sd)
    text = {"name": f"{key}_tolerance", "title": f"Tolerance of the {key}", "parameters": (size,)}
    known: Effect = type(f"{kind.__name__}Tolerance", (kind,), text)()
    return known
