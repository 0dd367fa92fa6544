"""femupdate benchmark training."""

import click

from ..command import benchmark_options
from ..result import Job, Report


@click.command("training")
@click.option(
    "--samples",
    type=click.IntRange(min=100),
    default=100_000,
    show_default=True,
    help="Simulations in the data set.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(min=0.0, min_open=True),
    default=10.0,
    show_default=True,
    help="Processor time of each network, minutes.",
)
@click.option(
    "--turn",
    type=click.FloatRange(min=1.0),
    default=30.0,
    show_default=True,
    help="Longest turn of one network, s of processor time.",
)
@benchmark_options
def command(job: Job, samples: int, minutes: float, turn: float) -> Report:
    """Train our MVAE and the published layout in turns, and compare the times to one loss.

    The building is the four-story one with the roof observed. The loss is -ln p(x'|theta) of noisy
    FRFs that were held out. Times are compared at the lowest loss of the published layout.
    """
    from .run import TrainingPlan, run_training

    return run_training(job, TrainingPlan(samples, minutes, turn))
