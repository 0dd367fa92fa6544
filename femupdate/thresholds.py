"""How tables of thresholds are written: a number, its unit, its meaning and its source.

`docs/reference/thresholds.md` lists all of them.
"""

from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")
CHOICE = "a choice; not measured by itself"


def entry(value: Any, unit: str, meaning: str, source: str = CHOICE) -> Any:
    """A field of a frozen dataclass, whose name and meaning read as one sentence.

    Args:
        meaning: what is decided by it.
        source: the trial, publication or reason that it comes from.
    """
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})


def table(entries: type[T]) -> T:
    """The one instance of a class of entries, under the name of the class; it cannot be changed.

    Type checkers, which take no notice of what a decorator returns, see the entries as those of the
    class.
    """
    # The name leads to the instance and not to its class, which is all that pickle needs.
    entries.__reduce__ = lambda self: type(self).__name__  # type: ignore[method-assign]
    return dataclass(frozen=True, kw_only=True)(entries)()
