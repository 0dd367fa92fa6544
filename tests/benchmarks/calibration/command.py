"""femupdate benchmark calibration."""

import click
from femupdate.cli.parameters import Names

from ..command import benchmark_options
from ..result import Job, Report


@click.command("calibration")
@click.option("--building", default="shear_4dof", show_default=True, help="Shipped name.")
@click.option(
    "--sensors",
    type=Names(),
    default=(),
    help="Observed floors, or `any` for random sets; default: the roof alone.",
)
@click.option(
    "--cases",
    type=click.IntRange(min=10),
    default=200,
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
@click.option("--latent", is_flag=True, help="Leave out the data-space posteriors.")
@click.option(
    "--beside",
    type=click.IntRange(min=0),
    help="Number of cases with data-space posteriors; default: all.",
)
@click.option(
    "--noise",
    type=click.FloatRange(min=1e-3),
    help="Noise on ln|H|; default: that of the training.",
)
@benchmark_options
def command(
    job: Job,
    building: str,
    sensors: tuple[str, ...],
    cases: int,
    particles: int,
    latent: bool,
    beside: int | None,
    noise: float | None,
) -> Report:
    """Coverage, ranks and TARP of latent and data-space posteriors over simulated buildings.

    The binomial error of the coverage of the 90 % region is 2 % with 200 cases and 1 % with 1000.
    Every case is kept in the folder --output, so an interrupted run resumes.
    """
    from .run import CalibrationPlan, run_calibration

    plan = CalibrationPlan(
        building=building,
        floors=sensors,
        cases=cases,
        particles=particles,
        beside=0 if latent and beside is None else beside,
        noise_sd=noise,
    )
    return run_calibration(job, plan)
