"""femupdate benchmark latent-size."""

from pathlib import Path

import click
from femupdate.cli.answer import print_json, print_pictures
from femupdate.cli.bars import Bars
from femupdate.cli.common import benchmark_options
from femupdate.cli.parameters import Names


@click.command("latent-size")
@click.option("--building", default="shear_4dof", show_default=True, help="Shipped name or file.")
@click.option("--sensors", type=Names(), default=(), help="Floors observed; default all.")
@click.option("--draws", type=click.IntRange(min=10), default=200, show_default=True)
@benchmark_options
def command(
    building: str,
    sensors: tuple[str, ...],
    draws: int,
    output_folder: Path,
    seed: int,
    as_json: bool,
) -> None:
    """What a latent space of fewer coordinates than parameters would lose of the data."""
    from .run import SizePlan, run_latent_size

    with Bars() as bars:
        report = run_latent_size(output_folder, SizePlan(building, sensors, draws), seed, bars)
    if as_json:
        print_json(
            {
                "machine": report.machine.sentence(),
                "enough": report.enough,
                "nats": [one.nats for one in report.losses],
                "results": [report.files.json, report.files.markdown],
            }
        )
        return
    click.echo(report.text)
    print_pictures((report.files.json, report.files.markdown))
