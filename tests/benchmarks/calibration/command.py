"""femupdate benchmark calibration."""

from pathlib import Path

import click
from femupdate.cli.answer import print_json, print_pictures
from femupdate.cli.bars import Bars
from femupdate.cli.common import benchmark_options
from femupdate.cli.parameters import Names


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
    building: str,
    sensors: tuple[str, ...],
    cases: int,
    particles: int,
    latent: bool,
    beside: int | None,
    noise: float | None,
    output_folder: Path,
    seed: int,
    as_json: bool,
) -> None:
    """Coverage, ranks and TARP of latent and data-space posteriors over simulated buildings.

    200 cases give the coverage of the 90 % region a binomial error of 2 %, 1000 of 1 %. Cases are
    kept in the folder --output as they are done: a run that was cut off goes on.
    """
    from .run import CalibrationPlan, run_calibration

    plan = CalibrationPlan(
        building,
        sensors,
        cases,
        particles,
        0 if latent and beside is None else beside,
        noise_sd=noise,
    )
    with Bars() as bars:
        report = run_calibration(output_folder, plan, seed, bars)
    if as_json:
        print_json(
            {
                "machine": report.machine.sentence(),
                "coverage": {
                    "nominal": report.latent.density.nominal,
                    "latent": report.latent.density.found,
                    "exact": None if report.exact is None else report.exact.density.found,
                    "error": report.latent.density.error,
                },
                "power": report.fit.power,
                "power_error": report.fit.error,
                "results": [report.files.json, report.files.markdown],
            }
        )
        return
    click.echo(report.text)
    print_pictures((report.files.json, report.files.markdown))
