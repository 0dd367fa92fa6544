"""Packages whose public names are imported when they are first used."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazily(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package: commands start without what they do not use.

    Args:
        modules: the module inside the package that holds each public name; "module:inner" where
            it has another name there.
    """

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, inner = modules[name].partition(":")
        return getattr(import_module(f"{package}.{module}"), inner or name)

    return get


def public(package: str, modules: Mapping[str, str]) -> tuple[list[str], Callable[[str], Any]]:
    """Return the `__all__` and the `__getattr__` of a room.

    Args:
        modules: the public names of each module of the room, parted by blanks.
    """
    where = {name: module for module, names in modules.items() for name in names.split()}
    return sorted(where), lazily(package, where)
