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
        for member in vars(content).values():
            here = inspect.isclass(member) and member.__module__ == content.__name__
            if here and issubclass(member, base):
                yield member
