"""femupdate compare."""

from pathlib import Path

import click

from femupdate.study import Study

from .answer import Answer
from .common import plain_options, study_option
from .help import GroupedCommand


@click.command("compare", cls=GroupedCommand)
@click.argument("before")
@click.argument("after")
@click.option(
    "--picture",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw the intervals of both into a PNG.",
)
@study_option
@plain_options
def command(before: str, after: str, picture: Path | None, study: Study) -> Answer:
    """Say which stories changed from BEFORE to AFTER an event.

    Both are posteriors of one building, each from a measurement of its own. They are named as
    `femupdate calibrate --name` named them in the study, or as study folders or posterior files.
    Changes nothing.

    \b
    Examples:
      femupdate calibrate before.csv --name before
      femupdate calibrate after.csv --name after
      femupdate compare before after
    """
    from femupdate.workflow.compare import compare_states, find_state

    report = compare_states(find_state(before, study), find_state(after, study))
    if picture is None:
        return Answer(report)
    from femupdate.workflow.pictures_posterior import draw_comparison

    return Answer(report, (draw_comparison(report, picture),))
