"""Finds the effects of the catalogue: every `Effect` in a module of its folder."""

from femupdate.effects import catalogue
from femupdate.effects.effect import Effect
from femupdate.errors import BuildingError
from femupdate.registry import classes_in

CATALOGUE: dict[str, Effect] = {kind.name: kind() for kind in classes_in(catalogue, Effect)}


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
