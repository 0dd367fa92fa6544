"""What is known to a tolerance alone: effects on every floor with priors as narrow as it is."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import torch
from torch import Tensor

from femupdate.building.common import MeshedBuilding, Tolerances
from femupdate.building.document import Building
from femupdate.effects.catalogue.added_mass import AddedMass
from femupdate.effects.catalogue.channels import BaseGain, ChannelDelay, ChannelGain
from femupdate.effects.catalogue.damping_law import OtherDampingLaw
from femupdate.effects.effect import Effect, Placed, Stiffness, Terms, change
from femupdate.effects.families import MemberStiffness
from femupdate.effects.structure import Structure

TOLERANCES = {
    "mass": "masses",
    "gain": "gains",
    "delay": "clocks",
    "damping_of_modes": "damping of modes",
    "members": "kinds of members",
}
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
        (_DampingOfModes, "damping_of_modes", stated.damping_of_modes, _OCTAVES),
        (_MembersOfAKind, "members", stated.members, _kinds(building)),
    )
    return tuple(
        Placed(_known_to(kind, key, sd), place)
        for kind, key, sd, places in varying
        for place in places
        if sd
    )


def tolerance_of(placed: Placed, present: Sequence[Placed]) -> int | None:
    """Which of the effects that are present lets the same vary within a tolerance, by number."""
    for number, other in enumerate(present):
        same = isinstance(other.effect, type(placed.effect)) and other.place == placed.place
        if same and key_of(f"{other.effect.name}@"):
            return number
    return None


def key_of(name: str) -> str:
    """The tolerance that a parameter such as "mass_tolerance@3F.size" is of; empty for others."""
    key, found, _ = name.partition("_tolerance@")
    return key if found else ""


_OCTAVES = ("f1", "2 f1", "4 f1", "8 f1")


class _DampingOfModes(OtherDampingLaw):
    """A factor on the damping ratio of modes about a multiple of the first frequency.

    It fades linearly in ln f towards the next octave; the last one holds for all modes beyond.
    """

    def places(self, structure: Structure) -> tuple[str, ...]:
        return _OCTAVES

    def terms(self, structure: Structure, place: str) -> Terms:
        """The first frequency and the number of the octave."""
        return Terms(constants=(structure.fundamental[0], float(_OCTAVES.index(place))))

    def damping(
        self, ratio: Tensor, omega: Tensor, sizes: Tensor, constants: tuple[float, ...]
    ) -> Tensor:
        """zeta (1 + s g), g = 1 at the octave and 0 at the next ones."""
        first, octave = constants
        away = torch.log2(omega / first).clamp(0.0, len(_OCTAVES) - 1.0) - octave
        share = (1.0 - away.abs()).clamp_min(0.0)
        return torch.clamp(ratio * (1.0 + sizes[:, :1] * share), 1e-4, 0.9)


class _MembersOfAKind(MemberStiffness):
    """A factor on the stiffness of all members of a kind, beside those of the stories."""

    parameters = change("change of the stiffness of a kind of member", 0.1, -0.9, 1.0)
    kinds = ()

    def places(self, structure: Structure) -> tuple[str, ...]:
        return _kinds(structure.building)

    def points(self, structure: Structure) -> tuple[str, ...]:
        return ()

    def terms(self, structure: Structure, place: str) -> Terms:
        """The stiffness of the members in every story, scaled by its factor."""
        matrices = enumerate(structure.member_stiffness((place,)))
        return Terms(stiffness=tuple(Stiffness(k, matrix) for k, matrix in matrices if matrix.nnz))


def _kinds(building: Building) -> tuple[str, ...]:
    """Kinds of members that a frame has, and that a mesh may have."""
    kinds = ("wall", "column", "beam", "slab", "brace", "infill")
    meshed = isinstance(building, MeshedBuilding)
    return tuple(kind for kind in kinds if getattr(building, f"{kind}s", meshed))


@lru_cache
def _known_to(kind: type[Effect], key: str, sd: float) -> Effect:
    """An effect of the catalogue whose size is known: zero, and the tolerance about it."""
    size = replace(kind.parameters[0], scale=sd)
    text = {"name": f"{key}_tolerance", "title": f"Tolerance of the {key}", "parameters": (size,)}
    known: Effect = type(f"{kind.__name__}Tolerance", (kind,), text)()
    return known
