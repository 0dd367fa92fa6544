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
    help="Floors observed, or `any`: sets drawn at random; default the roof alone.",
)
@click.option("--cases", type=click.IntRange(min=10), default=200, show_default=True)
@click.option("--particles", type=click.IntRange(min=200), default=1000, show_default=True)
@click.option("--latent", is_flag=True, help="Leave out the data-space posteriors.")
@click.option(
    "--beside",
    type=click.IntRange(min=0),
    help="Data-space posteriors for the first so many cases only; default all.",
)
@click.option(
    "--noise", type=click.FloatRange(min=1e-3), help="Noise on ln|H|; default as trained."
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

    200 cases give the coverage of the 90 % region a binomial error of 2 %, 1000 of 1 %. Cases are
    kept in the folder --output as they are done: a run that was cut off goes on.
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
