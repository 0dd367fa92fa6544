"""femupdate benchmark changes."""

import click

from ..command import benchmark_options
from ..result import Job, Report


@click.command("changes")
@click.option(
    "--pairs",
    type=click.IntRange(min=1),
    default=50,
    show_default=True,
    help="Simulated buildings, each measured before, without a change, and with one.",
)
@benchmark_options
def command(job: Job, pairs: int) -> Report:
    """Whether `compare` names a story softened by 10 %, and how often it raises a false alarm.

    Each building is shear_4dof with its own stiffness factors; once the model of it is right, and
    once it lacks a tenth of the mass of one floor.
    """
    from .run import run_changes

    return run_changes(job, pairs)
