"""How tables of thresholds are written: a number, its unit, its meaning and its source.

`docs/reference/thresholds.md` lists all of them.
"""

from dataclasses import field
from typing import Any

CHOICE = "a choice; not measured by itself"


def entry(value: Any, unit: str, meaning: str, source: str = CHOICE) -> Any:
    """A field of a frozen dataclass, whose name and meaning read as one sentence.

    Args:
        meaning: what is decided by it.
        source: the trial, publication or reason that it comes from.
    """
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})
