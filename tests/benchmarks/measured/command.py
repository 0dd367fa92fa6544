"""femupdate benchmark measured."""

from pathlib import Path

import click
from femupdate.cli.parameters import BuildingName, Columns, InputFile

from ..command import benchmark_options
from ..result import Job, Report


@click.command("measured")
@click.argument("files", type=InputFile(), nargs=-1, required=True)
@click.option("--building", type=BuildingName(), required=True, help="Shipped name or TOML file.")
@click.option("--base", default="base", show_default=True, help="Column of the base's motion.")
@click.option("--columns", type=Columns(), help="Column names: ours=theirs,...")
@click.option(
    "--particles", type=click.IntRange(min=200), default=1000, show_default=True, help="Draws."
)
@click.option(
    "--samples", type=click.IntRange(min=20), default=200, show_default=True, help="Histories."
)
@click.option("--several", is_flag=True, help="Each file from all others together.")
@benchmark_options
def command(
    job: Job,
    files: tuple[Path, ...],
    building: str,
    base: str,
    columns: dict[str, str] | None,
    particles: int,
    samples: int,
    several: bool,
) -> Report:
    """How honest intervals are: each of the measured FILES from every other, of one structure."""
    from .run import MeasuredPlan, run_measured

    plan = MeasuredPlan(building, files, base, columns, particles, samples, several)
    return run_measured(job, plan)
