"""Progress on stderr: bars where someone looks; in a log a line a step, and the time left."""

import math
import sys
import threading
from typing import Any

import click

_ALIKE = 10  # units of work and more are pieces alike; fewer are steps of any length


class Bars:
    """Progress on stderr: bars on a terminal and in a notebook, else lines.

    Args:
        every: seconds between two lines of a log on one step.
    """

    def __init__(self, every: float = 20.0) -> None:
        self._watched = sys.stderr.isatty() or "ipykernel" in sys.modules
        self._every = 1.0 if self._watched else every
        self._bar: Any = None
        self._over = threading.Event()

    def __enter__(self) -> "Bars":
        threading.Thread(target=self._tell, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._finish()

    def _tell(self) -> None:
        """Show again and again that a step which says nothing itself goes on."""
        while not self._over.wait(self._every):
            if (bar := self._bar) is not None:
                bar.refresh()

    def start(self, label: str, total: int) -> None:
        """Begin a bar."""
        from tqdm.auto import tqdm

        self._finish()
        alike, how = total >= _ALIKE, dict[str, Any]()
        if self._watched:
            times = "{elapsed}<{remaining}" if alike else "{elapsed}"
            told = "{desc}: {percentage:3.0f}%|{bar:30}| " + times + " {postfix}"
        else:
            click.echo(f"{label} ...", err=True)
            steps = "{n_fmt} of {total_fmt} steps, " * (total > 1) + "{elapsed} so far"
            told = "{desc}: " + ("{percentage:.0f} %, {remaining} left" if alike else steps)
            told += "{postfix}"
            how = {"file": _Lines(), "mininterval": math.inf, "delay": math.inf}
        self._bar = tqdm(total=total, desc=label, leave=False, bar_format=told, **how)

    def advance(self, count: int = 1, note: str = "") -> None:
        """Move the bar."""
        if self._bar is not None:
            if note:
                self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(min(count, self._bar.total - self._bar.n))

    def say(self, text: str) -> None:
        """Print a line between the bars."""
        if self._bar is not None:
            self._bar.clear()
        click.echo(text, err=True)

    def _finish(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class _Lines:
    """A log, in which nothing can be written over as tqdm does."""

    def write(self, text: str) -> None:
        if line := text.strip():
            click.echo(f"  {line}", err=True)

    def flush(self) -> None:
        pass
