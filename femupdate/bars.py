"""Progress on stderr."""

import sys
import threading
import time
from typing import Any

import click

from femupdate.progress import waiting

_ALIKE = 10  # units of work and more are pieces alike; fewer are steps of any length


class Bars:
    """Progress on stderr: bars where someone looks; in a log a line a step, and the time left."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._log: _Log | None = None
        self._watched = sys.stderr.isatty() or "ipykernel" in sys.modules  # of a notebook
        self._over = threading.Event()

    def __enter__(self) -> "Bars":
        threading.Thread(target=self._tell, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._finish()

    def _tell(self) -> None:
        """Show every second that a step which says nothing itself goes on."""
        while not self._over.wait(1.0):
            if (bar := self._bar) is not None:
                bar.refresh()
            elif (log := self._log) is not None:
                log.tell()

    def start(self, label: str, total: int) -> None:
        """Begin a bar."""
        self._finish()
        if not self._watched:
            click.echo(f"{label} ...", err=True)
            self._log = _Log(label, total)
            return
        from tqdm.auto import tqdm

        times = "{elapsed}<{remaining}" if total >= _ALIKE else "{elapsed}"
        self._bar = tqdm(
            total=total,
            desc=label,
            leave=False,
            bar_format="{desc}: {percentage:3.0f}%|{bar:30}| " + times + " {postfix}",
        )

    def advance(self, count: int = 1, note: str = "") -> None:
        """Move the bar."""
        if self._bar is not None:
            if note:
                self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(min(count, self._bar.total - self._bar.n))
        elif self._log is not None:
            self._log.advance(count, note)

    def say(self, text: str) -> None:
        """Print a line between the bars."""
        if self._bar is not None:
            self._bar.clear()
        click.echo(text, err=True)

    def _finish(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        self._log = None


class _Log:
    """Progress where there is no terminal: now and then a line with the time that is left.

    Of a few steps, which may take any time each, it tells the time so far instead.
    """

    def __init__(self, label: str, total: int) -> None:
        self._label, self._total, self._done, self._note = label, total, 0, ""
        self._started = self._told = time.monotonic()
        self._lock = threading.Lock()

    def advance(self, count: int, note: str) -> None:
        """Count, and say so if nothing was said for a while."""
        with self._lock:
            self._done, self._note = min(self._done + count, self._total), note
        self.tell()

    def tell(self) -> None:
        """Say how far it is if nothing was said for a while."""
        with self._lock:
            now = time.monotonic()
            # Twenty seconds between two lines of a log.
            if now - self._told < 20.0:
                return
            self._told, past, done = now, now - self._started, self._done
            if self._total >= _ALIKE and 0 < done < self._total:
                left = waiting(past * (self._total - done) / done)
                said = f"{100.0 * done / self._total:.0f} %, {left} left"
            else:
                steps = f"{done} of {self._total} steps, " * (1 < self._total < _ALIKE)
                said = f"{steps}{waiting(past)} so far"
            said += f", {self._note}" if self._note else ""
        click.echo(f"  {self._label}: {said}", err=True)
