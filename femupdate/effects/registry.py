"""Finds the effects of the catalogue: every `Effect` in a module of its folder."""

from femupdate.effects import catalogue
from femupdate.effects.effect import Effect
from femupdate.errors import BuildingError
from femupdate.registry import classes_in

_KINDS = classes_in(catalogue, Effect)  # type: ignore[type-abstract] # a module's are concrete
CATALOGUE: dict[str, Effect] = {kind.name: kind() for kind in _KINDS}


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
