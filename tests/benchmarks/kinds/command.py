"""femupdate benchmark kinds."""

import click

from ..command import benchmark_options
from ..result import Job, Report


@click.command("kinds")
@click.option(
    "--buildings",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    help="Simulated buildings.",
)
@benchmark_options
def command(job: Job, buildings: int) -> Report:
    """Whether histories, modes, force tests and ambient records agree, and narrow together.

    Each building is shear_3dof with its own stiffness factors.
    """
    from .run import run_kinds

    return run_kinds(job, buildings)
