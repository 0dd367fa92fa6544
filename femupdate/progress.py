"""How long-running steps report progress to their caller."""

import itertools
from collections.abc import Callable
from typing import Protocol, TypeVar

A = TypeVar("A")
T = TypeVar("T")


class Progress(Protocol):
    """Something that shows progress; the library itself prints nothing."""

    def start(self, label: str, total: int) -> None:
        """A piece of work of `total` units begins; it ends when the next one begins."""

    def advance(self, count: int = 1, note: str = "") -> None:
        """`count` more units are done; several threads may call this."""

    def say(self, text: str) -> None:
        """Something that the user should know."""


class Silent:
    """Shows nothing."""

    def start(self, label: str, total: int) -> None:
        """Ignore it."""

    def advance(self, count: int = 1, note: str = "") -> None:
        """Ignore it."""

    def say(self, text: str) -> None:
        """Ignore it."""


SILENT = Silent()


def counted(task: Callable[[A], T], progress: Progress, what: str, total: int) -> Callable[[A], T]:
    """The same task, which tells how many of the pieces inside a unit are done."""
    done = itertools.count(1)

    def told(argument: A) -> T:
        result = task(argument)
        progress.advance(0, f"{what}, {next(done)} of {total} done")
        return result

    return told


class Percent:
    """Advances a bar of 100 units a stage by the whole per cents that have become done."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._shown = progress, 0

    def reached(self, share: float, note: str = "") -> None:
        """Of this stage `share` is done; above 1 where the bar spans several stages."""
        percent = max(round(100.0 * share), self._shown)
        self._progress.advance(percent - self._shown, note)
        self._shown = percent


def waiting(seconds: float) -> str:
    """A time to wait, such as "about 4 min"."""
    if seconds < 90.0:
        return f"about {max(5.0, 5.0 * round(seconds / 5.0)):.0f} s"
    minutes = seconds / 60.0
    return f"about {minutes:.0f} min" if minutes < 90.0 else f"about {minutes / 60.0:.1f} h"
