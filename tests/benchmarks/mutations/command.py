"""femupdate benchmark mutations."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("mutations")
@click.option("--each", type=click.IntRange(min=1), default=40, show_default=True,
              help="Changes of each module, drawn at random.")  # fmt: skip
@click.option("--modules", type=Names(), default=(), help="Modules to change; default: some.")
@benchmark_options
def command(job: Job, each: int, modules: tuple[str, ...]) -> Report:
    """Change one operator or number at a time: do the tests of the module fail?

    Those that survive are listed. Some of them change nothing that can be seen.
    """
    from .run import run_mutations

    return run_mutations(job, each, modules)
