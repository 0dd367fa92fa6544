"""The `femupdate` command: a group whose commands are imported when they are called."""

import importlib
import sys

import click

from femupdate import __version__

# Command name to the module beside this one that holds it, in the order of the work.
_COMMANDS = {
    "build-model": "build_model",
    "train": "train",
    "calibrate": "calibrate",
    "predict": "predict",
    "render": "render",
    "simulate": "simulate",
    "demo": "demo",
}
_HELP = {
    "build-model": "Mesh, checks, modes, pictures and reduced model of a building.",
    "train": "Train the surrogate of a building; resumes, and is skipped when one fits.",
    "calibrate": "Posterior of the stiffness factors from a measured file.",
    "predict": "Floor histories and story shear-drift lines for a ground motion.",
    "render": "Mode shapes of the posterior, off screen.",
    "simulate": "Make a synthetic observation file from the full model.",
    "demo": "All of it on the shipped example, in minutes.",
}


class LazyGroup(click.Group):
    """A group that imports a command only to run it, so that --help is immediate."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the work."""
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module."""
        if cmd_name not in _COMMANDS:
            return None
        module = importlib.import_module(f".{_COMMANDS[cmd_name]}", __package__)
        command = module.command
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(_HELP.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Suggest the nearest name for a mistyped command."""
        if args and not args[0].startswith("-") and args[0] not in _COMMANDS:
            import difflib

            near = difflib.get_close_matches(args[0], _COMMANDS, n=1)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="femupdate")
def group() -> None:
    """Calibrate finite-element models of buildings to measured vibration.

    A study folder (--study, default ./study) holds everything made for one building. Every command
    builds what it needs and is missing, so `femupdate calibrate obs.csv` alone works.
    """


def main() -> None:
    """Run the command; errors meant for the user are one sentence and exit code 1."""
    try:
        group.main(standalone_mode=False)
    except click.exceptions.Exit as request:
        sys.exit(request.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted; run the same command again to go on.", err=True)
        sys.exit(130)
