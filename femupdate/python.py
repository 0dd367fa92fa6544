"""The functions of `femupdate` for people: messages in Python's words, progress in sessions."""

import functools
import sys
from typing import Any

from femupdate import interface
from femupdate.errors import FemupdateError, in_python


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

        tqdm.write(in_python(text))

    def close(self) -> None:
        """End the bar."""
        if self._bar is not None:
            self._bar.close()


def __getattr__(name: str) -> Any:
    verb = getattr(interface, name)
    shows = "progress" in verb.__annotations__

    @functools.wraps(verb)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        # Someone waits: at a prompt, or in a notebook.
        waits = hasattr(sys, "ps1") or "ipykernel" in sys.modules
        bars = SessionBars() if shows and waits and "progress" not in kwargs else None
        try:
            return verb(*args, **kwargs, **({"progress": bars} if bars else {}))
        except FemupdateError as error:
            error.args = (in_python(str(error)),)
            raise
        finally:
            if bars is not None:
                bars.close()

    return wrapper
