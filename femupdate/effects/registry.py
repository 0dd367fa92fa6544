"""The effects of the catalogue, by name, and those that a building lists."""

from dataclasses import dataclass

from femupdate.arrays import Floats
from femupdate.building.common import EffectEntry
from femupdate.building.document import Building
from femupdate.effects import catalogue
from femupdate.effects.effect import Effect, Placed
from femupdate.effects.structure import Structure
from femupdate.effects.tolerances import tolerances_of
from femupdate.errors import BuildingError
from femupdate.registry import classes_in

_KINDS = classes_in(catalogue, Effect)  # type: ignore[type-abstract] # a module's are concrete
CATALOGUE: dict[str, Effect] = {
    kind.name: kind() for kind in sorted(_KINDS, key=lambda kind: kind.name)
}


def effect_named(name: str) -> Effect:
    """Return an effect of the catalogue.

    Raises:
        BuildingError: there is none of that name.
    """
    if name not in CATALOGUE:
        raise BuildingError(
            f"effects: no effect is named {name!r}; the known ones are {', '.join(CATALOGUE)}"
        )
    return CATALOGUE[name]


@dataclass(frozen=True)
class BuildingEffects:
    """The effects that a building file lists."""

    placed: tuple[Placed, ...]  # effects at their places
    values: tuple[float, ...]  # all their parameters, one after the other


def building_effects(building: Building) -> BuildingEffects:
    """The effects of a building file, checked against the catalogue, and its tolerances.

    Raises:
        BuildingError: an effect or a parameter is unknown, a value is impossible, or the same
            effect is listed twice at one place.
    """
    placed: list[Placed] = []
    values: list[float] = []
    for number, entry in enumerate(building.effects):
        if entry.name not in CATALOGUE:
            raise BuildingError(
                f"{building.name}: effects[{number}].name: no effect is named {entry.name!r}; the "
                f"known ones are {', '.join(CATALOGUE)}"
            )
        effect = CATALOGUE[entry.name]
        if Placed(effect, entry.place) in placed:
            raise BuildingError(
                f"{building.name}: effects[{number}]: {entry.name} at {entry.place} is listed "
                "twice; keep one of the two"
            )
        known = {p.name: p for p in effect.parameters}
        for name, value in entry.parameters.items():
            if name not in known:
                raise BuildingError(
                    f"{building.name}: effects[{number}].parameters.{name}: {entry.name} has no "
                    f"such parameter; it has {', '.join(known) or 'none'}"
                )
            if not known[name].lower <= value <= known[name].upper:
                raise BuildingError(
                    f"{building.name}: effects[{number}].parameters.{name}: {value:g} must lie "
                    f"from {known[name].lower:g} to {known[name].upper:g}"
                )
        placed.append(Placed(effect, entry.place))
        values += [float(entry.parameters.get(p.name, p.neutral)) for p in effect.parameters]
    varying = tolerances_of(building)
    return BuildingEffects((*placed, *varying), (*values, *(0.0 for _ in varying)))


def check_places(structure: Structure, effects: BuildingEffects) -> None:
    """Make sure that every effect of a building can sit where its file says.

    Raises:
        BuildingError: it cannot.
    """
    for number, listed in enumerate(effects.placed):
        places = listed.effect.places(structure)
        if listed.place not in (*places, *listed.effect.points(structure)):
            raise BuildingError(
                f"{structure.building.name}: effects[{number}].place: {listed.effect.name} "
                f"cannot sit at {listed.place!r}; it can at {', '.join(places) or 'no place here'}"
            )


def with_effect(building: Building, placed: Placed, values: Floats) -> Building:
    """The building with one effect more."""
    parameters = {
        p.name: float(f"{v:.6g}") for p, v in zip(placed.effect.parameters, values, strict=True)
    }
    entry = EffectEntry(name=placed.effect.name, place=placed.place, parameters=parameters)
    return building.model_copy(update={"effects": (*building.effects, entry)})
