"""femupdate benchmark versions."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("versions")
@click.option(
    "--pythons",
    type=Names(),
    default="python3.11,python3.12,python3.13",
    show_default=True,
    help="Interpreters, as commands or paths; those that are missing are left out.",
)
@click.option("--tests", type=Names(), default=(), help="Tests to run; default: a fast part.")
@benchmark_options
def command(job: Job, pythons: tuple[str, ...], tests: tuple[str, ...]) -> Report:
    """A fast part of the tests with the lowest and the highest versions that pyproject allows.

    Every environment is new and is removed again: some GB and minutes each. The lowest versions
    are those of the first Python, as later ones have no packages of them.
    """
    from .run import FAST, run_versions

    return run_versions(job, pythons, tests or FAST)
