"""Floors told from the words with which stations say where their sensors sit."""

import re
from collections.abc import Sequence

from femupdate.measurement.columns import BASE, parse_channel

_ROOF = re.compile(r"\broof\b|\bRF\b", re.IGNORECASE)
_NUMBERED = re.compile(
    r"\b(\d+)(?:st|nd|rd|th)?[ _-]*(?:floor|flr?|level|story|storey)\b"
    r"|\b(?:floor|flr?|level|story|storey)[ _-]*(\d+)\b|(?<![A-Za-z0-9])(\d+)F\b",
    re.IGNORECASE,
)
_BELOW = re.compile(r"\bbasement\b|\bfoundation\b|\bground floor\b|\blobby\b|\bbase\b", re.I)
_BESIDE = re.compile(r"\bgr(?:oun|n)d\b|free[ -]?field|\bpit\b", re.IGNORECASE)


def floors_of(texts: Sequence[str]) -> tuple[str | None, ...]:
    """Return the floors that columns' names or sensors' locations tell, None where they do not.

    `Roof - center` is RF, `4th floor, east core` 4F; `Basement`, `Free field` and `1st Floor` are
    the base. Where a first floor stands beside a base or basement, the count begins above that.
    """
    numbers = [_number(text) for text in texts]
    based = any(n is None and base_rank(t) == 0 for n, t in zip(numbers, texts, strict=True))
    shift = 1 if based and 1 in numbers else 0
    return tuple(
        _floor(text, None if number is None else number + shift)
        for text, number in zip(texts, numbers, strict=True)
    )


def base_rank(text: str) -> int:
    """Return 0 for a place in the building's base, 1 for the ground beside it, 2 for no base."""
    number, words = _number(text), text.replace("_", " ")
    if number == 1 or (number is None and _BELOW.search(words)):
        return 0
    return 1 if number is None and _BESIDE.search(words) else 2


def _floor(text: str, number: int | None) -> str | None:
    channel = parse_channel(text)
    if channel is not None:
        return channel.floor
    if _ROOF.search(text.replace("_", " ")):
        return "RF"
    if number is not None:
        return f"{number}F" if number > 1 else BASE
    return BASE if base_rank(text) < 2 else None


def _number(text: str) -> int | None:
    if parse_channel(text) is not None or _ROOF.search(text.replace("_", " ")):
        return None
    match = _NUMBERED.search(text.replace("_", " "))
    return int(next(group for group in match.groups() if group)) if match else None
