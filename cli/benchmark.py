"""femupdate benchmark NAME: runs the benchmarks of a checkout; an installed package has none."""

from importlib import import_module
from importlib.util import find_spec

import click

from .group import Failure

_PACKAGE = "femupdate.benchmarks"
_HELP = "Published tables and other programs, side by side with ours."
_MISSING = (
    "the benchmarks are not part of the installed package; clone the repository of femupdate and "
    f"run `python -m {_PACKAGE} NAME` in its root folder"
)


@click.command(
    "benchmark",
    help=f"{_HELP}\nHere {_MISSING}.",
    context_settings={"ignore_unknown_options": True},
)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def absent(arguments: tuple[str, ...]) -> None:
    """Say how to get the benchmarks, whatever is asked."""
    raise Failure(_MISSING)


# What each benchmark needs is imported when it runs.
command: click.Command = (
    absent if find_spec(_PACKAGE) is None else import_module(f"{_PACKAGE}.commands").group
)
