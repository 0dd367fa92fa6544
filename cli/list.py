"""femupdate list."""

import click

from .answer import Answer
from .common import plain_options
from .help import GroupedCommand


@click.command("list", cls=GroupedCommand)
@plain_options
def command() -> Answer:
    """List shipped buildings, effects with their places and units, and formats of measured files.

    Buildings go by their name wherever a building file is taken.

    \b
    Example:
      femupdate list
    """
    from femupdate.workflow.listing import list_all

    return Answer(list_all())
