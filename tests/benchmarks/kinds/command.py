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
@click.option("--building", default="shear_3dof", show_default=True, help="Shipped building.")
@benchmark_options
def command(job: Job, building: str, buildings: int) -> Report:
    """Whether histories, FRFs, modes, force tests and ambient records agree, and narrow together.

    Each building has its own stiffness factors.
    """
    from .run import run_kinds

    return run_kinds(job, building, buildings)
