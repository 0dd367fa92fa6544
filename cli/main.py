"""The `femupdate` command: a group whose commands are imported when they are called."""

import os
import sys
from collections.abc import Sequence

import click

from femupdate import __version__

from .group import LazyGroup

# Command name to the module beside this one that holds it, with its name there, and its line in the
# help, in the order of the work.
_COMMANDS = {
    "inspect": ("measured:inspect", "Say what is in measured files and what looks wrong."),
    "identify": (
        "measured:identify",
        "Identify modes from floor motions alone (ambient vibration).",
    ),
    "build-model": (
        "build:build_model",
        "Build and reduce the model of a building, and draw its modes.",
    ),
    "train": ("build:train", "Train the surrogate of a building."),
    "calibrate": (
        "observations:calibrate",
        "Draw the posterior of the stiffness factors from measured files.",
    ),
    "predict": ("predict", "Predict floor histories and story shears for a ground motion."),
    "diagnose": (
        "observations:diagnose",
        "Find where model and measurement disagree, and what is missing.",
    ),
    "repair": ("observations:repair", "Add what is missing, and show before and after."),
    "render": ("predict:render", "Draw mode shapes of the posterior."),
    "compare": ("study:compare", "Say which stories changed between two posteriors."),
    "report": ("study:report", "Write one HTML page with everything that a study says."),
    "status": ("study:status", "Say what a study holds, what is stale, and what to do next."),
    "simulate": ("simulate", "Make a synthetic observation file from the full model."),
    "benchmark": ("benchmark", "Compare with published tables and other programs."),
    "list": ("shipped:listing", "List shipped buildings, effects, and formats of measured files."),
    "examples": ("shipped:examples", "Copy the shipped example files into a folder."),
    "demo": ("shipped:demo", "Run the whole chain on a shipped example, in minutes."),
}


@click.group(
    cls=LazyGroup, commands=_COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.version_option(__version__, prog_name="femupdate")
def group() -> None:
    """Calibrate finite-element models of buildings to measured vibration.

    A study folder (--study, default ./study) holds everything for one building, which is named
    once. Every command builds what it needs.

    \b
    Examples:
      femupdate demo
      femupdate inspect obs.csv
      femupdate calibrate obs.csv --building my_building.toml
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command with these arguments, by default those of the process.

    Errors meant for the user are one sentence and exit code 1.
    """
    # Threads that wait for each other sleep soon, unless the user has said how they wait. GNU's
    # OpenMP, which torch is built with, reads this when it is loaded. On busy processors its
    # threads else spin for longer than they work; on idle ones it makes no difference.
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", "1000")
    # Pieces of work have a thread each already: on two processors more inside of them cost a
    # prediction a third more processor time, and more by the clock. Steps of a training have none.
    if "OMP_NUM_THREADS" not in os.environ:
        training = "train" in (sys.argv[1:] if arguments is None else arguments)
        os.environ.setdefault("OPENBLAS_NUM_THREADS" if training else "OMP_NUM_THREADS", "1")
    try:
        group.main(arguments, prog_name="femupdate", standalone_mode=False)
    except click.exceptions.Exit as request:
        sys.exit(request.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted; run the same command again to go on.", err=True)
        sys.exit(130)
