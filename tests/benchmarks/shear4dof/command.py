"""femupdate benchmark shear4dof."""

from pathlib import Path

import click
from femupdate.cli.answer import print_json, print_pictures
from femupdate.cli.bars import Bars
from femupdate.cli.common import benchmark_options


@click.command("shear4dof")
@click.option("--runs", type=click.IntRange(min=2), default=10, show_default=True)
@click.option(
    "--observations",
    type=click.IntRange(min=1),
    default=20,
    show_default=True,
    help="Simulated buildings that latent posterior and bridge are judged on.",
)
@click.option(
    "--nuts",
    type=click.IntRange(min=0),
    is_flag=False,
    flag_value=2000,
    default=0,
    metavar="[ITERATIONS]",
    help="Also a chain of the No-U-Turn sampler on each likelihood, 2,000 iterations without a "
    'number (published: 60,000); needs pip install "femupdate[nuts]".',
)
@click.option("--quick", is_flag=True, help="A few runs of few particles, to see it work.")
@benchmark_options
def command(
    runs: int,
    observations: int,
    nuts: int,
    quick: bool,
    output_folder: Path,
    seed: int,
    as_json: bool,
) -> None:
    """The four-story posterior with four modes: published tables, beside the exact posterior."""
    from dataclasses import replace

    from .run import QUICK, Plan, run_shear4dof

    plan = replace(QUICK if quick else Plan(runs=runs, observations=observations), nuts=nuts)
    with Bars() as bars:
        report = run_shear4dof(output_folder, seed, plan, bars)
    if as_json:
        print_json(
            {
                "machine": report.machine.sentence(),
                "solutions": report.case.solutions,
                "exact_weight": report.exact.modes.weight,
                "log_evidence": report.exact.weighted.log_evidence,
                "results": [report.files.json, report.files.markdown],
                "pictures": report.pictures,
            }
        )
        return
    click.echo(report.text)
    print_pictures((report.files.json, report.files.markdown, *report.pictures))
