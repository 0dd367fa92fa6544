"""femupdate benchmark frame-coverage."""

from pathlib import Path

import click

from ..command import benchmark_options
from ..result import Job, Report

BUILDING = Path(__file__).with_name("three_story_frame.toml")


@click.command("frame-coverage")
@click.option(
    "--building", default=str(BUILDING), help="Shipped name or file; default: three stories."
)
@click.option(
    "--cases",
    type=click.IntRange(min=1),
    default=40,
    show_default=True,
    help="Simulated buildings.",
)
@click.option(
    "--particles",
    type=click.IntRange(min=200),
    default=1000,
    show_default=True,
    help="Posterior draws for each.",
)
@click.option("--latent", is_flag=True, help="Latent posteriors in place of the data-space ones.")
@benchmark_options
def command(job: Job, building: str, cases: int, particles: int, latent: bool) -> Report:
    """Share of the 90 % intervals of frames that hold a truth which another model made.

    Truths are of a mesh of .4 or .6 times the building's own, or of OpenSees with two kinds of
    shells; half of them are shaken by white noise, half by earthquakes. Damping is .5 to 3 %.
    Every case is kept in the folder --output, so an interrupted run resumes.
    """
    from .run import CoveragePlan, run_coverage

    plan = CoveragePlan(building=building, cases=cases, particles=particles, exact=not latent)
    return run_coverage(job, plan)
