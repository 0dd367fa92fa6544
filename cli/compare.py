"""femupdate compare."""

from pathlib import Path

import click

from .answer import Answer
from .common import plain_options


@click.command("compare")
@click.argument("before", type=click.Path(exists=True, path_type=Path))
@click.argument("after", type=click.Path(exists=True, path_type=Path))
@click.option(
    "--picture",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw the intervals of both into a PNG.",
)
@plain_options
def command(before: Path, after: Path, picture: Path | None) -> Answer:
    """Say which stories changed from the study BEFORE to the study AFTER an event.

    Both are study folders or posterior files of one building, each from a measurement of its own.
    Changes nothing.

    \b
    Example:
      femupdate calibrate before.csv --study before
      femupdate calibrate after.csv --study after
      femupdate compare before after
    """
    from femupdate.workflow.compare import compare_states, open_state

    report = compare_states(open_state(before), open_state(after))
    if picture is None:
        return Answer(report)
    from femupdate.workflow.pictures_posterior import draw_comparison

    return Answer(report, (draw_comparison(report, picture),))
