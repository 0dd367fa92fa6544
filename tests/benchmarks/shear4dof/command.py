"""femupdate benchmark shear4dof."""

from dataclasses import replace

import click

from ..command import benchmark_options
from ..result import Job, Report


@click.command("shear4dof")
@click.option(
    "--runs",
    type=click.IntRange(min=2),
    default=10,
    show_default=True,
    help="Runs of each sampler.",
)
@click.option(
    "--observations",
    type=click.IntRange(min=1),
    default=20,
    show_default=True,
    help="Simulated buildings on which latent posterior and bridge are judged.",
)
@click.option(
    "--nuts",
    type=click.IntRange(min=0),
    is_flag=False,
    flag_value=2000,
    default=0,
    metavar="[ITERATIONS]",
    help="Also run a chain of the No-U-Turn sampler on each likelihood, by default of 2,000 "
    'iterations (published: 60,000); needs pip install "femupdate[nuts]".',
)
@click.option("--quick", is_flag=True, help="A few runs with few particles, to try it out.")
@benchmark_options
def command(job: Job, runs: int, observations: int, nuts: int, quick: bool) -> Report:
    """The four-story posterior with four modes, beside published tables and the exact posterior."""
    from .run import QUICK, Shear4dofPlan, run_shear4dof

    plan = QUICK if quick else Shear4dofPlan(runs=runs, observations=observations)
    return run_shear4dof(job, replace(plan, nuts=nuts))
