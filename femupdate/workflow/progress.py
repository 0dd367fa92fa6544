"""How long steps tell their caller how far they are."""

from typing import Protocol


class Progress(Protocol):
    """Something that shows progress; the library itself prints nothing."""

    def start(self, label: str, total: int) -> None:
        """A piece of work of `total` units begins; it ends when the next one begins."""
        ...

    def advance(self, count: int = 1, note: str = "") -> None:
        """So many units more are done."""
        ...

    def say(self, text: str) -> None:
        """Something that the user should know."""
        ...


class Silent:
    """Shows nothing."""

    def start(self, label: str, total: int) -> None:
        """Ignore it."""

    def advance(self, count: int = 1, note: str = "") -> None:
        """Ignore it."""

    def say(self, text: str) -> None:
        """Ignore it."""
