"""Writes nested tables of text, numbers and lists as TOML 1.0, with a comment an entry."""

import json
import re
from collections.abc import Callable, Mapping
from typing import Any

from femupdate.building.entry import dotted

Comment = Callable[[str], str | None]
_WIDTH = 80  # characters beyond which a list takes one line an item
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _basic(name)


def _basic(text: str) -> str:
    # JSON's escapes are all TOML escapes; DEL is the one character only TOML wants escaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _text(text: str) -> str:
    if "\n" not in text:
        return _basic(text)
    lines = (_basic(line)[1:-1] for line in text.split("\n"))
    return '"""\n' + "\n".join(lines) + '"""'


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        items = [_value(item) for item in value]
        long = sum(map(len, items)) > _WIDTH
        return "[\n    " + ",\n    ".join(items) + ",\n]" if long else f"[{', '.join(items)}]"
    raise TypeError(f"TOML has no way to write {type(value).__name__}")


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _entries(table: Mapping[str, Any], path: tuple[str | int, ...], comment: Comment) -> list[str]:
    lines = []
    for name, value in table.items():
        if not isinstance(value, Mapping) and not _is_tables(value):
            said = comment(dotted((*path, name)))
            lines.append(f"{_key(name)} = {_value(value)}" + (f"  # {said}" if said else ""))
    return lines


def _tables(
    table: Mapping[str, Any], header: tuple[str, ...], path: tuple[str | int, ...], comment: Comment
) -> list[str]:
    lines: list[str] = []
    for name, value in table.items():
        below = (*header, _key(name))
        if isinstance(value, Mapping):
            own = _entries(value, (*path, name), comment)
            # A table that only holds tables needs no header of its own.
            lines += ["", f"[{'.'.join(below)}]", *own] if own or not value else []
            lines += _tables(value, below, (*path, name), comment)
        elif _is_tables(value):
            for number, row in enumerate(value):
                inner = (*path, name, number)
                lines += ["", f"[[{'.'.join(below)}]]", *_entries(row, inner, comment)]
                lines += _tables(row, below, inner, comment)
    return lines


def to_toml(document: Mapping[str, Any], comment: Comment = lambda key: None) -> str:
    """Return the document as TOML text.

    Args:
        document: tables (mappings), lists of tables, and texts, numbers, flags or lists of them.
        comment: what to write behind the entry with this dotted key, None for nothing.

    Raises:
        TypeError: a value of another type.
    """
    lines = [*_entries(document, (), comment), *_tables(document, (), (), comment)]
    return "\n".join(lines).lstrip("\n") + "\n"
