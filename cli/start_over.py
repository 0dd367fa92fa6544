"""femupdate start-over."""

import click

from femupdate.study import Study
from femupdate.study_lock import locked

from .answer import Answer
from .common import plain_options, study_option
from .help import GroupedCommand


@click.command("start-over", cls=GroupedCommand)
@click.option("--yes", is_flag=True, help="Do not ask.")
@study_option
@plain_options
def command(study: Study, yes: bool) -> Answer:
    """Remove all that femupdate wrote into a study, so that it can begin again.

    Says first what goes and what stays, and asks. Measured files, records and whatever else
    femupdate did not write stay where they are.

    \b
    Example:
      femupdate start-over --study house
    """
    from femupdate.workflow.start_over import plan_removal, remove

    removal = plan_removal(study)
    if not yes:
        click.echo(removal.question(), err=True)
        try:
            click.confirm("Remove them?", abort=True, err=True)
        except click.Abort:
            click.echo("\nNothing was removed; --yes removes without asking.", err=True)
            click.get_current_context().exit(1)
    with locked(study.folder, "start-over"):
        remove(removal)
    return Answer(removal)
