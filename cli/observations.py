"""femupdate calibrate, diagnose and repair: what measured files say of a building."""

from pathlib import Path
from typing import Any

import click

from femupdate.bars import Bars
from femupdate.study import MAIN_POSTERIOR, Study

from .common import (
    Answer,
    F,
    building_option,
    flag,
    observations_argument,
    option,
    reading_options,
    study_options,
    together,
)
from .group import GroupedCommand
from .parameters import INPUT_FILE


@click.command("calibrate", cls=GroupedCommand)
@observations_argument
@building_option
@flag("--exact", "Sample the likelihood of the data themselves.")
@option(
    "--particles",
    "Draws of the posterior (particles): more give smoother intervals and take longer.",
    click.IntRange(200),
    5000,
)
@option("--chains", "Runs of the sampler apart, whose agreement is checked.", click.IntRange(1), 4)
@option(
    "--name", "Name of the posterior; a study keeps any number of them.", default=MAIN_POSTERIOR
)
@flag("--anyway", "Keep a posterior even where the file is unlike the building.")
@reading_options
@study_options()
def calibrate(observations: tuple[Path, ...], study: Study, bars: Bars, **asked: Any) -> Answer:
    """Draw the posterior of the stiffness factors from the measured files OBSERVATIONS.

    Each file is a CSV table of histories (time_s, base, 2F, ..., RF), of FRFs (frequency_hz, 2F,
    ..., RF), of FRFs under a force (frequency_hz, 2F/RF, ..., RF/RF for a force at RF) or of
    identified modes (mode, frequency_hz, damping, 2F, ..., RF). Several sensors on one floor are
    named 2F:1, 2F:2. Several files, of one kind or of several, are measurements of
    the same building, which one posterior explains together. The options hold for all files.

    \b
    Examples:
      femupdate examples
      femupdate calibrate examples/run1.csv --building shear_4dof
      femupdate calibrate examples/run1.csv --sensors RF --name roof
    """
    from femupdate import interface

    return Answer(interface.calibrate(study, *observations, progress=bars, **asked))


def finder_options(function: F) -> F:
    """Add what both commands take beside files and building."""
    share, of = click.FloatRange(0.0, 1.0), "that is of consequence, as a ratio."
    return together(
        option("--least-frequency", f"Change of a frequency {of}", share, 0.01),
        option("--least-response", f"Change or error of a response {of}", share, 0.02),
        reading_options,
    )(function)


@click.command("diagnose", cls=GroupedCommand)
@observations_argument
@building_option
@finder_options
@study_options()
def diagnose(observations: tuple[Path, ...], study: Study, bars: Bars, **asked: Any) -> Answer:
    """Find where the model and the measured files OBSERVATIONS disagree, and what is missing.

    Every effect of the catalogue is tested at every place. The leading ones are fitted, and their
    evidence is weighed. Nothing is changed: `femupdate repair` adds what was found. Files are of
    any kind that `calibrate` takes, alone or together: histories and FRFs under base motion, FRFs
    under a force, identified modes.

    \b
    Examples:
      femupdate diagnose examples/run1.csv --building shear_4dof
      femupdate diagnose run1.csv stronger_run.csv
      femupdate diagnose hammer.csv modes.csv
    """
    from femupdate import interface

    report = interface.diagnose(study, *observations, progress=bars, **asked)
    return Answer(report, {"diagnosis": report.path})


@click.command("repair", cls=GroupedCommand)
@observations_argument
@building_option
@option("--holdout", "Data that are only predicted, before and after.", INPUT_FILE)
@finder_options
@study_options()
def repair(observations: tuple[Path, ...], study: Study, bars: Bars, **asked: Any) -> Answer:
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

    report = interface.repair(study, *observations, progress=bars, **asked)
    return Answer(report, {"repair": report.path})
