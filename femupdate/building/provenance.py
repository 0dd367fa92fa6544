"""Which figures of a building are published and which are assumed."""

import re
from typing import Literal

from femupdate.building.document import leaf_keys, to_document
from femupdate.building.schema import Building

Origin = Literal["published", "assumed"]
_TEXTS = ("name", "title", "description", "kind", "provenance")
_STEP = re.compile(r"[^.\[\]]+|\[(?:\d+|\*)\]")


def _steps(key: str) -> list[str]:
    return _STEP.findall(key)


def _covers(entry: str, key: str) -> bool:
    """Whether the entry is the key or its beginning; `[*]` stands for any place in a list."""
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
    return tuple((e, origin) for origin, entries in lists for e in entries if _covers(e, key))


def provenance_of(building: Building, key: str) -> Origin | None:
    """Return where the figure at a dotted key (`walls[2].thickness`) comes from, None if unsaid.

    Where several entries cover the key, the one with the most steps decides.
    """
    if not _is_figure(key):
        return None
    found = entries_for(building, key)
    return max(found, key=lambda item: len(_steps(item[0])))[1] if found else None


def _is_figure(key: str) -> bool:
    return _steps(key)[0] not in _TEXTS and not key.endswith("].name")


def figure_keys(building: Building) -> tuple[str, ...]:
    """Return the dotted keys of everything that has an origin: all but names and texts."""
    keys = leaf_keys(to_document(building))
    return tuple(key for key in keys if _is_figure(key))


def uncovered_keys(building: Building) -> tuple[str, ...]:
    """Return the keys of the figures whose origin the building does not say."""
    return tuple(key for key in figure_keys(building) if not entries_for(building, key))


def disputed_keys(building: Building) -> tuple[str, ...]:
    """Return the keys of the figures that more than one entry covers."""
    return tuple(key for key in figure_keys(building) if len(entries_for(building, key)) > 1)


def idle_entries(building: Building) -> tuple[str, ...]:
    """Return the provenance entries that cover no figure."""
    keys = figure_keys(building)
    entries = (*building.provenance.published, *building.provenance.assumed)
    return tuple(entry for entry in entries if not any(_covers(entry, key) for key in keys))
