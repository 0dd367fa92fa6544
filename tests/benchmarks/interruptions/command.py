"""femupdate benchmark interruptions."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("interruptions")
@click.option(
    "--each",
    type=click.IntRange(min=1),
    default=8,
    show_default=True,
    help="Interruptions of each kind of each command.",
)
@click.option(
    "--processes",
    type=click.IntRange(min=1),
    default=2,
    show_default=True,
    help="Commands at a time.",
)
@click.option(
    "--kind",
    "kinds",
    type=click.Choice(["killed", "file limit", "disk full"]),
    multiple=True,
    help="Of interruption, repeatable; default: all.",
)
@click.option("--commands", type=Names(), default=(), help="Commands to try; default: all.")
@benchmark_options
def command(
    job: Job, each: int, processes: int, kinds: tuple[str, ...], commands: tuple[str, ...]
) -> Report:
    """Commands killed, out of disk or at a limit, then run again: nothing may be lost.

    The second run must end with the result of an undisturbed one, to the last digit.
    """
    from .run import InterruptionPlan, run_interruptions

    return run_interruptions(job, InterruptionPlan(each, processes, commands, kinds))
