"""femupdate calibrate, diagnose and repair: what measured files say of a building."""

import functools
from pathlib import Path
from typing import Any

import click

from femupdate.study import MAIN_POSTERIOR, Study

from .answer import Answer
from .bars import Bars
from .common import (
    F,
    Tables,
    building_option,
    device_option,
    drawn,
    observations_argument,
    reading_options,
    study_options,
    table_options,
)
from .group import GroupedCommand
from .parameters import InputFile


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
@device_option
@click.option(
    "--anyway", is_flag=True, help="Keep a posterior even where the file is unlike the building."
)
@reading_options
@study_options(shares=True)
@table_options("posterior")
def calibrate(
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


def finder_options(function: F) -> F:
    """Add what both commands take beside files and building.

    The function gets `second`, `use_phase` and, in `noticed`, what an engineer would notice; what
    is left out is not in it.
    """
    share = click.FloatRange(min=0.0, max=1.0)

    @click.option("--second", type=InputFile(), help="Second record at another level of motion.")
    @click.option("--no-phase", is_flag=True, help="Use the amplitude alone.")
    @click.option(
        "--least-frequency",
        type=share,
        help="Change of a frequency that is of consequence, as a ratio; default 0.01.",
    )
    @click.option(
        "--least-response",
        type=share,
        help="Change or error of a response that is, as a ratio; default 0.02.",
    )
    @functools.wraps(function)
    def wrapper(*args: Any, no_phase: bool, **kwargs: Any) -> Any:
        given = {name: kwargs.pop(name) for name in ("least_frequency", "least_response")}
        noticed = {name: value for name, value in given.items() if value is not None}
        return function(*args, noticed=noticed, use_phase=not no_phase, **kwargs)

    return wrapper  # type: ignore[return-value]


@click.command("diagnose", cls=GroupedCommand)
@observations_argument
@building_option
@finder_options
@reading_options
@study_options(shares=True)
@table_options("diagnosis")
def diagnose(
    observations: tuple[Path, ...],
    noticed: dict[str, Any],
    tables: Tables,
    study: Study,
    bars: Bars,
    pictures: bool,
    **asked: Any,
) -> Answer:
    """Find where the model and the measured files OBSERVATIONS disagree, and what is missing.

    Every effect of the catalogue is tested at every place. The leading ones are fitted, and their
    evidence is weighed. Nothing is changed: `femupdate repair` adds what was found. Files are of
    any kind that `calibrate` takes, alone or together: histories and FRFs under base motion, FRFs
    under a force, identified modes.

    \b
    Examples:
      femupdate diagnose examples/six_story_white_noise.csv
      femupdate diagnose run1.csv --second stronger_run.csv
      femupdate diagnose hammer.csv modes.csv
    """
    from femupdate import interface

    report = interface.diagnose(study, *observations, progress=bars, **noticed, **asked)
    written = tables.write(study, report)
    made = drawn(report, study.path("pictures"), pictures, bars)
    return Answer(report, made, {"diagnosis": report.path}, tables=written)


@click.command("repair", cls=GroupedCommand)
@observations_argument
@building_option
@click.option("--holdout", type=InputFile(), help="Data that are only predicted, before and after.")
@finder_options
@reading_options
@study_options(shares=True)
def repair(
    observations: tuple[Path, ...],
    noticed: dict[str, Any],
    study: Study,
    bars: Bars,
    pictures: bool,
    **asked: Any,
) -> Answer:
    """Add to the model what the measured files OBSERVATIONS show to be missing.

    At most four effects are added, each only on clear evidence. The repaired building is a study
    of its own in the folder `repaired` of this study. Every command takes it. Files are of any
    kind that `calibrate` takes, alone or together.

    \b
    Examples:
      femupdate repair run1.csv --holdout run2.csv
      femupdate report --study study/repaired
    """
    from femupdate import interface

    report = interface.repair(study, *observations, progress=bars, **noticed, **asked)
    made = drawn(report, study.path("pictures"), pictures, bars)
    return Answer(report, made, {"repair": report.path})
