"""The functions of `femupdate` for people: messages in Python's words, progress in sessions."""

import functools
import sys
from collections.abc import Mapping
from inspect import signature
from typing import Any

from femupdate import errors, interface
from femupdate.study import made_by


class SessionBars:
    """Progress as bars of a notebook or a prompt."""

    def __init__(self) -> None:
        self._bar: Any = None

    def start(self, label: str, total: int) -> None:
        """Begin a bar."""
        from tqdm.auto import tqdm

        self.close()
        self._bar = tqdm(total=total, desc=label, leave=False)

    def advance(self, count: int = 1, note: str = "") -> None:
        """Move the bar."""
        if self._bar is not None:
            self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(min(count, self._bar.total - self._bar.n))

    def say(self, text: str) -> None:
        """Write a line above the bar."""
        from tqdm.auto import tqdm

        tqdm.write(errors.in_python(text))

    def close(self) -> None:
        """End the bar."""
        if self._bar is not None:
            self._bar.close()


_COMMANDS = {verb: command for command, verb in errors.VERBS.items()} | {"reduce": "build-model"}
_OPTIONS = {ours: option for option, ours in errors.KEYWORDS.items()}
_SAID = {"files": [], "spectrum_damping": ["--floor-spectra", "--spectrum-damping"]}
_MANY = ("members", "wanted", "files")  # each has an option, or stands, by itself


def words_of(name: str, given: Mapping[str, Any]) -> list[str]:
    """The command that does what a call does, for those who do it again."""
    study, words = given["study"], [_COMMANDS[name]]
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
        bars = SessionBars() if shows and waits and "progress" not in kwargs else None
        given = signature(verb).bind(*args, **kwargs).arguments
        given |= given.pop("settings", {})
        try:
            with made_by(words_of(name, given) if "study" in given else ()):
                return verb(*args, **kwargs, **({"progress": bars} if bars else {}))
        except errors.FemupdateError as error:
            error.args = (errors.in_python(str(error)),)
            raise
        finally:
            if bars is not None:
                bars.close()

    return wrapper
