"""femupdate calibrate."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import MAIN_POSTERIOR, Study

from .answer import Answer
from .bars import Bars
from .common import (
    Tables,
    building_option,
    drawn,
    observations_argument,
    reading_options,
    study_options,
    table_options,
)
from .group import GroupedCommand


@click.command("calibrate", cls=GroupedCommand)
@observations_argument
@building_option
@click.option("--exact", is_flag=True, help="Sample the likelihood of the data themselves.")
@click.option(
    "--particles",
    type=click.IntRange(min=200),
    default=5000,
    show_default=True,
    help="Draws of the posterior (particles): more give smoother intervals and take longer.",
)
@click.option(
    "--chains",
    type=click.IntRange(min=1),
    default=4,
    show_default=True,
    help="Runs of the sampler apart, whose agreement is checked.",
)
@click.option(
    "--name",
    default=MAIN_POSTERIOR,
    show_default=True,
    help="Name of the posterior; a study keeps any number of them.",
)
@click.option("--device", default="cpu", show_default=True, help="Device for torch: cpu, cuda, ...")
@click.option(
    "--anyway", is_flag=True, help="Keep a posterior even where the file is unlike the building."
)
@reading_options
@study_options(shares=True)
@table_options("posterior")
def command(
    observations: tuple[Path, ...],
    name: str,
    tables: Tables,
    study: Study,
    bars: Bars,
    pictures: bool,
    **asked: Any,
) -> Answer:
    """Draw the posterior of the stiffness factors from the measured files OBSERVATIONS.

    Each file is a CSV table of histories (time_s, base, 2F, ..., RF), of FRFs (frequency_hz, 2F,
    ..., RF), of FRFs under a force (frequency_hz, 2F/RF, ..., RF/RF for a force at RF) or of
    identified modes (mode, frequency_hz, damping, 2F, ..., RF). Several sensors on one floor are
    named 2F:1, 2F:2. Several files, of one kind or of several, are measurements of
    the same building, which one posterior explains together. The options hold for all files.

    \b
    Examples:
      femupdate examples
      femupdate calibrate examples/six_story_white_noise.csv
      femupdate calibrate examples/six_story_white_noise.csv --sensors RF --name roof
    """
    from femupdate import interface

    study = Study(study.folder, name)
    report = interface.calibrate(study, *observations, name=name, progress=bars, **asked)
    written = tables.write(study, report)
    return Answer(report, drawn(report, study.result("pictures"), pictures, bars), tables=written)
