"""femupdate status."""

import click

from femupdate.study import Study

from .answer import Answer
from .common import plain_options, posterior_options
from .help import GroupedCommand


@click.command("status", cls=GroupedCommand)
@plain_options
@posterior_options
def command(study: Study) -> Answer:
    """Say what a study holds, what is stale, and what to do next. Changes nothing.

    \b
    Examples:
      femupdate status
      femupdate status --posterior roof
    """
    from femupdate.workflow.status import study_status

    return Answer(study_status(study))
