"""femupdate benchmark NAME: runs the benchmarks of a checkout; an installed package has none."""

from importlib import import_module
from importlib.util import find_spec

import click

from .common import Failure
from .lazy import LazyGroup

_PACKAGE = "femupdate.benchmarks"
_HELP = """Published tables and other programs, side by side with ours.

Each benchmark prints its table and writes it, with machine and date, as JSON and Markdown
into the folder --output.
"""
_MISSING = (
    "the benchmarks are not part of the installed package; clone the repository of femupdate and "
    f"run `python -m {_PACKAGE} NAME` in its root folder"
)


def _present() -> click.Group:
    """All benchmarks, each imported when it is called."""
    return LazyGroup(
        "benchmark", help=_HELP, commands=import_module(_PACKAGE).COMMANDS, package=_PACKAGE
    )


def _absent() -> click.Command:
    """A command that says how to get the benchmarks, whatever it is asked."""

    @click.command(
        "benchmark",
        help=f"{_HELP}\nHere {_MISSING}.",
        context_settings={"ignore_unknown_options": True},
    )
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def command(arguments: tuple[str, ...]) -> None:
        raise Failure(_MISSING)

    return command


command = _absent() if find_spec(_PACKAGE) is None else _present()
