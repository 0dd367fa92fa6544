"""Effects to be hidden in a simulation, from their labels."""

from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.effects.effect import Placed
from femupdate.effects.registry import effect_named
from femupdate.effects.structure import require_story_factors, structure_of
from femupdate.errors import BuildingError


def parse_effect(
    building: Building, label: str, values: tuple[float, ...]
) -> tuple[Placed, tuple[float, ...]]:
    """An effect and its parameters from its label, such as "added_mass@3F".

    Args:
        values: its first parameters; the others are neutral.

    Raises:
        BuildingError: no such effect or place, or too few, too many or impossible parameters.
    """
    name, _, place = label.partition("@")
    effect = effect_named(name)
    if effect.needs_levels:
        raise BuildingError(
            f"{building.name}: {name} shows between two levels of motion; simulate each with its "
            "own --theta, --zeta and --rms"
        )
    require_story_factors(building)
    structure = structure_of(building, _coarse(building))
    places = effect.places(structure)
    if place not in (*places, *effect.points(structure)):
        raise BuildingError(
            f"{building.name}: {name} cannot sit at {place!r}; it can at "
            f"{', '.join(places) or 'no place here'}"
        )
    own = effect.parameters
    if len(values) > len(own):
        raise BuildingError(
            f"{label}: {len(values)} numbers were given; it takes "
            f"{', '.join(p.name for p in own) or 'none'}"
        )
    if own and not values:
        raise BuildingError(f"{label}: give its {own[0].name}, such as {label}={own[0].scale:g}")
    for one, value in zip(own, values, strict=False):
        if not one.lower <= value <= one.upper:
            raise BuildingError(
                f"{label}: {one.name} {value:g} must lie from {one.lower:g} to {one.upper:g}"
            )
    return Placed(effect, place), (*values, *(p.neutral for p in own[len(values) :]))


def _coarse(building: Building) -> float | None:
    """A mesh size that is enough to know the places of effects."""
    return 2.0 * building.mesh.size if isinstance(building, FrameBuilding) else None
