"""femupdate benchmark latent-size."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("latent-size")
@click.option("--building", default="shear_4dof", show_default=True, help="Shipped name or file.")
@click.option("--sensors", type=Names(), default=(), help="Observed floors; default: all.")
@click.option(
    "--draws",
    type=click.IntRange(min=10),
    default=200,
    show_default=True,
    help="Draws for the directions, and pairs of buildings.",
)
@benchmark_options
def command(job: Job, building: str, sensors: tuple[str, ...], draws: int) -> Report:
    """What a latent space with fewer coordinates than parameters would lose of the data."""
    from .run import LatentSizePlan, run_latent_size

    return run_latent_size(job, LatentSizePlan(building, sensors, draws))
