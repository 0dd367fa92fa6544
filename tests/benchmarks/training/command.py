"""femupdate benchmark training."""

from pathlib import Path

import click
from femupdate.cli.answer import print_json, print_pictures
from femupdate.cli.bars import Bars
from femupdate.cli.common import benchmark_options


@click.command("training")
@click.option("--samples", type=click.IntRange(min=100), default=100_000, show_default=True)
@click.option(
    "--minutes",
    type=click.FloatRange(min=0.0, min_open=True),
    default=10.0,
    show_default=True,
    help="Of the processor for each of the two.",
)
@click.option(
    "--turn",
    type=click.FloatRange(min=1.0),
    default=30.0,
    show_default=True,
    help="Longest turn of either, s of the processor.",
)
@benchmark_options
def command(
    samples: int, minutes: float, turn: float, output_folder: Path, seed: int, as_json: bool
) -> None:
    """Train our MVAE and the published layout in turns, and compare the times to one loss.

    The building is the four-story one, seen at its roof; the loss is -ln p(x'|theta) of held-out
    noisy FRFs, and the loss at which times are compared is the lowest of the published layout.
    """
    from .run import Plan, run_training_benchmark

    with Bars() as bars:
        report = run_training_benchmark(output_folder, Plan(samples, minutes, turn), seed, bars)
    if as_json:
        print_json(
            {
                "machine": report.machine.sentence(),
                "loss": report.reached.loss,
                "limit": report.limit,
                "cpu_ratio": report.reached.cpu_ratio,
                "clock_ratio": report.reached.clock_ratio,
                "results": [report.files.json, report.files.markdown],
                "pictures": [report.picture],
            }
        )
        return
    click.echo(report.text)
    print_pictures((report.files.json, report.files.markdown, report.picture))
