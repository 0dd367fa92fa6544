"""What commands print on stdout."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from femupdate.result import Result, plain


@dataclass(frozen=True)
class Answer:
    """What a command prints when its work is done.

    Attributes:
        pictures: files drawn; None of a command that draws none of its own.
        more: goes into the JSON object as well.
        files: other files written, named beside the pictures.
        tables: CSV files written, named to those who ask for more; None where none could be.
    """

    result: Result
    pictures: tuple[Path, ...] | None = None
    more: dict[str, Any] = field(default_factory=dict)
    files: Sequence[Path] = ()
    tables: tuple[Path, ...] | None = None

    def show(self, as_json: bool, details: bool = False) -> None:
        """Print it, for scripts or for people."""
        drawn = {} if self.pictures is None else {"pictures": self.pictures}
        if self.tables is not None:
            drawn["tables"] = self.tables
        if as_json:
            content = {**self.result.as_dict(), **plain({**drawn, **self.more})}
            click.echo(json.dumps(content, indent=2))
            return
        click.echo("\n".join(self.result.lines(details)))
        tables = (self.tables or ()) if details else ()
        print_pictures((*(self.pictures or ()), *self.files, *tables))


def print_pictures(pictures: tuple[Path, ...]) -> None:
    """Print the path of each picture once."""
    for picture in dict.fromkeys(pictures):
        click.echo(f"  {picture}")
