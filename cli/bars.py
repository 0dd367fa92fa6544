"""Progress on stderr."""

import sys
from typing import Any

import click


class Bars:
    """Progress on stderr: bars on a terminal, one line for each step in a log."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._on_terminal = sys.stderr.isatty()

    def __enter__(self) -> "Bars":
        return self

    def __exit__(self, *_: object) -> None:
        self._finish()

    def start(self, label: str, total: int) -> None:
        """Begin a bar."""
        self._finish()
        if not self._on_terminal:
            click.echo(f"{label} ...", err=True)
            return
        from tqdm import tqdm

        self._bar = tqdm(
            total=total,
            desc=label,
            leave=False,
            delay=0.5,
            bar_format="{desc}: {percentage:3.0f}%|{bar:30}| {elapsed}<{remaining} {postfix}",
        )

    def advance(self, count: int = 1, note: str = "") -> None:
        """Move the bar."""
        if self._bar is not None:
            if note:
                self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(count)

    def say(self, text: str) -> None:
        """Print a line between the bars."""
        if self._bar is not None:
            self._bar.clear()
        click.echo(text, err=True)

    def _finish(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
