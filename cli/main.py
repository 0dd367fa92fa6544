"""The `femupdate` command: a group whose commands are imported when they are called."""

import sys
from collections.abc import Sequence

import click

from femupdate import __version__

from .lazy import LazyGroup

# Command name to the module beside this one that holds it, and its line in the help, in the order
# of the work.
_COMMANDS = {
    "build-model": (
        "build_model",
        "Mesh, checks, modes, pictures and reduced model of a building.",
    ),
    "train": ("train", "Train the surrogate of a building; resumes, and is skipped when one fits."),
    "calibrate": ("calibrate", "Posterior of the stiffness factors from a measured file."),
    "predict": ("predict", "Floor histories and story shear-drift lines for a ground motion."),
    "diagnose": ("diagnose", "Where model and measurement disagree, and what is missing."),
    "repair": ("repair", "Add what is missing, update, and show the gap before and after."),
    "render": ("render", "Mode shapes of the posterior, off screen."),
    "simulate": ("simulate", "Make a synthetic observation file from the full model."),
    "benchmark": ("benchmark", "Published tables and other programs, side by side with ours."),
    "demo": ("demo", "All of it on the shipped example, in minutes."),
}


@click.group(
    cls=LazyGroup,
    commands=_COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="femupdate")
def group() -> None:
    """Calibrate finite-element models of buildings to measured vibration.

    A study folder (--study, default ./study) holds everything made for one building. Every command
    builds what it needs and is missing, so `femupdate calibrate obs.csv` alone works.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command with these arguments, by default those of the process.

    Errors meant for the user are one sentence and exit code 1.
    """
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
