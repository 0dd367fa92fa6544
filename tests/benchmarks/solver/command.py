"""femupdate benchmark solver."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("solver")
@click.option(
    "--sizes",
    type=Names(),
    default="small",
    show_default=True,
    help="Buildings of the speed comparison: small, medium, large, with commas (1,680, 8,640 and "
    '31,110 shells; seconds, minutes and a quarter of an hour), or "" for none.',
)
@benchmark_options
def command(job: Job, sizes: tuple[str, ...]) -> Report:
    """Element tests against published values; speed against OpenSees."""
    from .run import run_solver

    return run_solver(job, sizes)
