"""What every command is: imported when called, its help under headings, its words noted."""

import importlib
from collections.abc import Mapping
from typing import Any

import click

from femupdate.errors import close
from femupdate.study import made_by

# Heading of an option, by its longest name; what is not listed is a setting of the computation.
_HEADINGS = {
    "What is read": (
        *("building", "record", "channel", "unit", "scale", "sensors", "band", "columns"),
        *("measured", "holdout", "study", "force"),
        "posterior",
    ),
    "What is written": (
        *("name", "output", "no-pictures", "picture", "export"),
        *("json", "overwrite"),
    ),
    "General": ("seed", "verbose", "quiet", "help", "version"),
}
_SETTINGS = "How it is done"
_ORDER = ("What is read", _SETTINGS, "What is written", "General")

# A study that is recorded in knows its folder and its building, and not how it was told of them.
_NOT_NOTED = {"study", "copy", "building", "as_json", "verbose", "quiet"}
_WORDS = f"{__name__}.words"


class Failure(click.ClickException):
    """A command that failed: one plain sentence, exit code 1."""

    exit_code = 1

    def show(self, file: Any = None) -> None:
        """Print the sentence on stderr."""
        click.echo(f"Error: {self.format_message()}", err=True)


class GroupedCommand(click.Command):
    """A command whose help has its options under headings, and which studies can name."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments, and keep them as they were written."""
        written = list(args)
        try:
            rest = super().parse_args(ctx, args)
        except click.MissingParameter:
            raise
        except click.BadParameter as error:  # an input like any other
            raise Failure(error.format_message()) from error
        ctx.meta[_WORDS] = [ctx.info_name or "", *self._words(ctx, written)]
        return rest

    def _words(self, ctx: click.Context, written: list[str]) -> list[str]:
        """What to type to have the same done again, in a study that is there."""
        values, _, given = self.make_parser(ctx).parse_args(written)
        files, options = [], []
        for parameter in dict.fromkeys(given):
            value = values.get(parameter.name or "")
            if parameter.name in _NOT_NOTED or value is None:
                continue
            several = value if isinstance(value, list | tuple) else (value,)
            if isinstance(parameter, click.Argument):
                files += [file for file in several if isinstance(file, str)]
            elif getattr(parameter, "is_flag", False):
                options.append(longest_name(parameter))
            else:
                options += [word for part in several for word in (longest_name(parameter), part)]
        return [*files, *options]

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what it records is noted as its work."""
        with made_by(ctx.meta[_WORDS]):
            return super().invoke(ctx)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, those of a heading in the order in which they are declared."""
        headings = {name: heading for heading, names in _HEADINGS.items() for name in names}
        under: dict[str, list[tuple[str, str]]] = {heading: [] for heading in _ORDER}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and isinstance(parameter, click.Option):
                under[headings.get(longest_name(parameter).lstrip("-"), _SETTINGS)].append(record)
        for heading, records in under.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records)


def longest_name(parameter: click.Parameter) -> str:
    """Such as --verbose of -v and --verbose."""
    return max(parameter.opts, key=len)


class LazyGroup(click.Group):
    """A group that imports a command only to run it, so that --help is immediate.

    Args:
        commands: name of each command to the module that holds it, and its line in the help; in
            the order of the help. "module:name" is the command of that name in the module, which
            is `command` where none is said.
    """

    def __init__(self, *args: Any, commands: Mapping[str, tuple[str, str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.modules = dict(commands)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the help."""
        return list(self.modules)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module."""
        if cmd_name not in self.modules:
            return None
        module, _, name = self.modules[cmd_name][0].partition(":")
        command = getattr(importlib.import_module(f".{module}", __package__), name or "command")
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in self.modules.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Suggest the nearest name for a mistyped command."""
        if args and not args[0].startswith("-") and args[0] not in self.modules:
            ctx.fail(f"No such command {args[0]!r}{close(args[0], self.modules)}")
        return super().resolve_command(ctx, args)
