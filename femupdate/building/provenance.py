"""Which figures of a building are published and which are assumed."""

import re
from typing import Literal

from femupdate.building.schema import Building

Origin = Literal["published", "assumed"]
_TEXTS = ("name", "title", "description", "kind", "provenance")
_STEP = re.compile(r"[^.\[\]]+|\[(?:\d+|\*)\]")


def _steps(key: str) -> list[str]:
    return _STEP.findall(key)


def covers(entry: str, key: str) -> bool:
    """Return whether the entry is the key or its beginning; `[*]` stands for any list place."""
    said, asked = _steps(entry), _steps(key)
    return len(said) <= len(asked) and all(
        s == a or (s == "[*]" and a.startswith("[")) for s, a in zip(said, asked, strict=False)
    )


def entries_for(building: Building, key: str) -> tuple[tuple[str, Origin], ...]:
    """Return every entry of the provenance lists that covers the key, with its list."""
    lists: tuple[tuple[Origin, tuple[str, ...]], ...] = (
        ("published", building.provenance.published),
        ("assumed", building.provenance.assumed),
    )
    return tuple((e, origin) for origin, entries in lists for e in entries if covers(e, key))


def provenance_of(building: Building, key: str) -> Origin | None:
    """Return where the figure at a dotted key (`walls[2].thickness`) comes from, None if unsaid.

    Where several entries cover the key, the one with the most steps decides.
    """
    if not is_figure(key):
        return None
    found = entries_for(building, key)
    return max(found, key=lambda item: len(_steps(item[0])))[1] if found else None


def is_figure(key: str) -> bool:
    """Return whether the entry at a key has an origin: all but names and texts have."""
    return _steps(key)[0] not in _TEXTS and not key.endswith("].name")
