"""femupdate status."""

import click

from femupdate.study import Study

from .answer import Answer
from .common import plain_options
from .parameters import StudyFolder


@click.command("status")
@click.option(
    "--study",
    type=StudyFolder(),
    default="study",
    show_default=True,
    help="Folder that holds everything for one building.",
)
@plain_options
def command(study: Study) -> Answer:
    """Say what a study holds, what is stale, and what to do next. Changes nothing."""
    from femupdate.workflow.status import study_status

    return Answer(study_status(study))
