"""What every command is: its help has headings, and what it records has its words."""

from typing import Any

import click

from femupdate.study import made_by

# Heading of an option, by its longest name; what is not listed is a setting of the computation.
_HEADINGS = {
    "What is read": (
        *("building", "record", "channel", "unit", "scale", "sensors", "band", "columns"),
        *("mapping", "measured", "second", "holdout", "start", "study"),
        "posterior",
    ),
    "What is written": (
        *("name", "output", "xlsx", "no-pictures", "picture", "export", "shell", "gif"),
        *("write-mapping", "json", "force"),
    ),
    "General": ("seed", "verbose", "help", "version"),
}
_SETTINGS = "How it is done"
_ORDER = ("What is read", _SETTINGS, "What is written", "General")

# A study that is recorded in knows its folder and its building, and not how it was told of them.
_NOT_NOTED = {"study", "copy", "building", "as_json", "verbose"}
_WORDS = f"{__name__}.words"


class GroupedCommand(click.Command):
    """A command whose help has its options under headings, and which studies can name."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments, and keep them as they were written."""
        written = list(args)
        rest = super().parse_args(ctx, args)
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
                files += [one for one in several if isinstance(one, str)]
            elif getattr(parameter, "is_flag", False):
                options.append(_name(parameter))
            else:
                options += [word for one in several for word in (_name(parameter), one)]
        return [*files, *options]

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what it records is noted as its work."""
        with made_by(ctx.meta[_WORDS]):
            return super().invoke(ctx)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, those of a heading in the order in which they are declared."""
        found: dict[str, list[tuple[str, str]]] = {heading: [] for heading in _ORDER}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and isinstance(parameter, click.Option):
                found[_heading(parameter)].append(record)
        for heading, records in found.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records)


def _name(parameter: click.Parameter) -> str:
    return max(parameter.opts, key=len)


def _heading(parameter: click.Parameter) -> str:
    name = _name(parameter).lstrip("-")
    if name == "force" and not getattr(parameter, "is_flag", False):
        return "What is read"  # the floor that was hit; the flag replaces a file
    for heading, names in _HEADINGS.items():
        if name in names:
            return heading
    return _SETTINGS
