"""Errors that femupdate raises on purpose: each says what is wrong, where, and what to do."""

import difflib
import re
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any

_NOT_SHOWN = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")


def brief(self: Any) -> str:
    """A `__repr__` of a line or two: the fields that say something, arrays by their shape."""

    def told(value: Any) -> str:
        if hasattr(value, "shape"):
            return f"<{' x '.join(map(str, value.shape))}>"
        short = isinstance(value, tuple) and all(isinstance(each, str | float) for each in value)
        if short or isinstance(value, str | int | float | PurePath):
            return repr(value) if len(str(value)) < 60 else f"{str(value)[:56]!r}..."
        return type(value).__name__ + (f" of {len(value)}" if hasattr(value, "__len__") else "")

    fields = {k: v for k, v in vars(self).items() if k[0] != "_" and v is not None}
    said = [f"{key}={told(value)}" for key, value in fields.items()]
    return f"{type(self).__name__}({', '.join(said)})"


class FemupdateError(Exception):
    """Base of every error whose message is meant to be read by the user as it stands.

    What a damaged file says may stand in it: the message is one line of a length that can be read.
    """

    def __init__(self, message: str = "") -> None:
        def shortened(text: str, longest: int) -> str:
            # Its end says what to do.
            half = (longest - 5) // 2
            return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"

        line = _NOT_SHOWN.sub(" ", message).strip()
        words = " ".join(shortened(word, 300) for word in line.split(" ") if word)
        super().__init__(shortened(words, 2000))


def close(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" with the nearest known name, or nothing."""
    folded = {item.casefold(): item for item in known}
    near = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.6)
    return f"; did you mean {folded[near[0]]!r}?" if near else ""


class UnitError(FemupdateError):
    """A quantity has no unit, an unknown unit or a unit of another kind."""


class BuildingError(FemupdateError):
    """A building file is missing, malformed or describes something that cannot stand."""


class StructureError(FemupdateError):
    """The finite-element model cannot be solved (mechanism, flat element, no support...)."""


class MeasurementError(FemupdateError):
    """A record or observation file cannot be used."""


class SurrogateError(FemupdateError):
    """A trained surrogate is missing, stale or does not fit the building."""


class InferenceError(FemupdateError):
    """The posterior cannot be drawn (no particle with a finite likelihood, for instance)."""


class StudyError(FemupdateError):
    """The study folder lacks an artefact, holds a stale one or cannot be written."""


class ReportError(FemupdateError):
    """A figure or a picture cannot be made from what was given, or cannot be written."""
