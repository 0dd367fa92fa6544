"""femupdate examples."""

from pathlib import Path

import click

from .answer import Answer
from .common import plain_options
from .help import GroupedCommand


@click.command("examples", cls=GroupedCommand)
@click.argument("folder", type=click.Path(path_type=Path), default="examples")
@plain_options
def command(folder: Path) -> Answer:
    """Copy the shipped example files into FOLDER, by default ./examples.

    Files that are there already stay as they are.

    \b
    Examples:
      femupdate examples
      femupdate calibrate examples/six_story_white_noise.csv
    """
    from femupdate.workflow.examples import copy_examples

    return Answer(copy_examples(folder))
