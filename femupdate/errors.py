"""Errors that femupdate raises on purpose: each says what is wrong, where, and what to do."""

import difflib
import re
import shlex
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any

_NOT_SHOWN = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")


# The function of every command; those that take no study, and those named alone.
_SAME = (
    "calibrate compare demo diagnose identify inspect predict render repair simulate status train"
)
VERBS = {"report": "write_report", "build-model": "build_model", "list": "catalogue"}
VERBS |= {"examples": "copy_examples", **{name: name for name in _SAME.split()}}
_FREE, _ALONE = ("identify", "inspect", "list", "examples"), ("list", "status", "report", "train")
_COMMAND = re.compile(rf"(`?)femupdate ({'|'.join(VERBS)})\b([^`\n;]*?)(\.?)(?:`|(?=[;\n]|$))")
_PAIRS = r"(?:time_s|frequency_hz|(?:base|force|RF|\d+F)[\w/.:@-]*)=[^\s,;]+"
_PAIRS += f"(?:,{_PAIRS})*"
_OPTION = re.compile(
    rf"--([a-z][a-z-]*)(?:[ =]({_PAIRS}|\"[^\"]*\"|[A-Z]{{4,}}|m/s2\S*|[\d.]*\d))?"
)
KEYWORDS = {"band": "band_hz", "rms": "rms_m_s2", "mode": "wanted", "member": "members"}
_FLAGS = ("anyway", "exact", "fresh")


def _value(text: str, key: str = "") -> str:
    """A word, or the value of an option, as Python writes it."""
    if key == "columns":
        pairs = (pair.partition("=")[::2] for pair in text.split(","))
        return "{" + ", ".join(f'"{ours}": "{theirs}"' for ours, theirs in pairs) + "}"
    if key == "band":
        return f"({text})"
    # What the user is to put in, or a number.
    return text if re.fullmatch(r"[A-Z]+|-?[\d.]+(e-?\d+)?", text) else f'"{text}"'


def _keyword(key: str, text: str) -> str:
    value = _value(text, key) if text else "True" * (key in _FLAGS)
    return f"{KEYWORDS.get(key, key.replace('-', '_'))}={value}"


def _call(found: re.Match[str]) -> str:
    """A command as it is called."""
    ticks, command, rest, end = found.groups()[:4]
    words, given, named = shlex.split(rest), list[str](), dict[str, str]()
    while words:
        word = words.pop(0)
        if word.startswith("--") and word[2:] != "record":
            named[word[2:]] = words.pop(0) if words and word[2:] not in _FLAGS else ""
        elif word[0] != "-":
            given.append(_value(word))
    study = _value(named.pop("study")) if "study" in named else "study"
    if posterior := named.pop("posterior", ""):
        study = f"femupdate.Study({study}, {_value(posterior)})"
    listed = [study][command in _FREE :] + given + [_keyword(*pair) for pair in named.items()]
    listed += [] if rest or command in _ALONE else ["..."]
    return f"{ticks}femupdate.{VERBS[command]}({', '.join(listed)}){end}{ticks}"


def in_python(text: str) -> str:
    """A message in the words of Python: functions for commands, keywords for options."""

    def option(found: re.Match[str]) -> str:
        value = (found[2] or "").strip('"')
        if found[1] == "posterior":
            return "`Study(folder, posterior)`"
        return f"`{_keyword(found[1], value.rstrip('.'))}`" + "." * value.endswith(".")

    text = text.replace("; -v tells more", "")
    text = re.sub(r"the (band|columns|force|unit) option", r"--\1", text)
    text = _OPTION.sub(option, _COMMAND.sub(_call, text))
    some = rf"(such as |, or )({_PAIRS})"
    return re.sub(some, lambda found: found[1] + _value(found[2], "columns"), text)


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
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"; did you mean {near[0]!r}?" if near else ""


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
