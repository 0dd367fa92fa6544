"""Finds what extends the program: the classes of one kind in the modules of a package."""

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


def classes_in(package: ModuleType, base: type[T]) -> Iterator[type[T]]:
    """Yield the classes of a kind that a package's modules define, by module name."""
    for module in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
        content = importlib.import_module(f"{package.__name__}.{module}")
        for found in vars(content).values():
            own = inspect.isclass(found) and found.__module__ == content.__name__
            if own and issubclass(found, base):
                yield found
