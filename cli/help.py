"""The help of a command: its options under headings, in the order of the work."""

import click

# Heading of an option, by its longest name; what is not listed is a setting of the computation.
_HEADINGS = {
    "What is read": (
        *("building", "record", "channel", "unit", "scale", "sensors", "band", "columns"),
        *("mapping", "measured", "second", "holdout", "start", "study"),
        "posterior",
    ),
    "What is written": (
        *("name", "output", "xlsx", "no-pictures", "picture", "export", "shell", "gif"),
        *("write-mapping", "json", "force", "yes"),
    ),
    "General": ("seed", "verbose", "help", "version"),
}
_SETTINGS = "How it is done"
_ORDER = ("What is read", _SETTINGS, "What is written", "General")


class GroupedCommand(click.Command):
    """A command whose help has its options under headings."""

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


def _heading(parameter: click.Parameter) -> str:
    name = max(parameter.opts, key=len).lstrip("-")
    if name == "force" and not getattr(parameter, "is_flag", False):
        return "What is read"  # the floor that was hit; the flag replaces a file
    for heading, names in _HEADINGS.items():
        if name in names:
            return heading
    return _SETTINGS
