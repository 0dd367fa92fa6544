"""femupdate benchmark fuzz."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("fuzz")
@click.option(
    "--files",
    type=click.IntRange(min=1),
    default=20_000,
    show_default=True,
    help="Mutated files in all.",
)
@click.option(
    "--processes",
    type=click.IntRange(min=1),
    default=2,
    show_default=True,
    help="Readers at a time.",
)
@click.option("--subjects", type=Names(), default=(), help="Kinds of file; default: all.")
@benchmark_options
def command(job: Job, files: int, processes: int, subjects: tuple[str, ...]) -> Report:
    """Mutated files for every reader: each must be read, or refused in one sentence.

    No other exception, no hang over 5 s, no more than 2 GB of memory, nothing left behind.
    """
    from .run import FuzzPlan, run_fuzz

    return run_fuzz(job, FuzzPlan(files, processes, subjects))
