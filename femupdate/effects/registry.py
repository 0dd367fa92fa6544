"""Finds the effects of the catalogue: every `Effect` in a module of its folder."""

import importlib
import inspect
import pkgutil

from femupdate.effects import catalogue
from femupdate.effects.effect import Effect
from femupdate.errors import BuildingError


def _found() -> dict[str, Effect]:
    effects = {}
    for module in sorted(info.name for info in pkgutil.iter_modules(catalogue.__path__)):
        content = importlib.import_module(f"{catalogue.__name__}.{module}")
        for kind in vars(content).values():
            own = inspect.isclass(kind) and issubclass(kind, Effect)
            if own and kind.__module__ == content.__name__ and not inspect.isabstract(kind):
                effects[kind.name] = kind()
    return effects


CATALOGUE: dict[str, Effect] = _found()


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
