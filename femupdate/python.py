"""The functions of `femupdate` for people: studies note what was called, sessions see progress."""

import functools
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from inspect import signature
from typing import Any

from femupdate import interface
from femupdate.bars import Bars
from femupdate.study import made_by

_COMMANDS = {"reduce": "build-model", "build_model": "build-model", "write_report": "report"}
_OPTIONS = {"band_hz": "band", "rms_m_s2": "rms", "wanted": "mode", "members": "member"}
_SAID = {"files": [], "spectrum_damping": ["--floor-spectra", "--spectrum-damping"]}
_MANY = ("members", "wanted", "files")  # each has an option, or stands, by itself


def words_of(name: str, given: Mapping[str, Any]) -> list[str]:
    """The command that does what a call does, for those who do it again."""
    study, words = given["study"], [_COMMANDS.get(name, name)]
    for key, value in given.items():
        option = _SAID.get(key, ["--" + _OPTIONS.get(key, key).replace("_", "-")])
        if key in ("study", "building", "progress") or value is None or value is False:
            continue
        if isinstance(value, Mapping):
            value = ",".join(f"{ours}={theirs}" for ours, theirs in value.items())
        for each in value if key in _MANY else (value,):
            each = interface.path_of(study, each) if key in ("files", "record") else each
            said = ",".join(map(str, each)) if isinstance(each, list | tuple) else str(each)
            words += option if value is True else [*option, said]
    named = getattr(study, "posterior", "posterior")
    return words + ["--posterior", named] * (named != "posterior")


def __getattr__(name: str) -> Any:
    verb = getattr(interface, name)
    shows = "progress" in verb.__annotations__

    @functools.wraps(verb)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        # Someone waits: at a prompt, or in a notebook.
        waits = hasattr(sys, "ps1") or "ipykernel" in sys.modules
        given = signature(verb).bind(*args, **kwargs).arguments
        given |= given.pop("settings", {})
        with (
            made_by(words_of(name, given) if "study" in given else ()),
            Bars() if shows and waits and "progress" not in kwargs else nullcontext() as bars,
        ):
            return verb(*args, **kwargs, **({"progress": bars} if bars else {}))

    return wrapper
