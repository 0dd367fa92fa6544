"""femupdate report."""

from contextlib import ExitStack
from pathlib import Path

import click

from femupdate.study import Study
from femupdate.study_lock import locked

from .answer import Answer
from .bars import Bars
from .common import plain_options, posterior_options
from .help import GroupedCommand


@click.command("report", cls=GroupedCommand)
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="HTML file to write; default report.html in the study.",
)
@plain_options
@posterior_options
def command(study: Study, output: Path | None) -> Answer:
    """Write one HTML page with everything that a study says, to hand on.

    The page needs no network and nothing beside it. It shows what was done and from which files,
    the building with its modes, the data, the fit, the posterior, the prediction, what the model
    lacks, and all warnings. With --output, the study is only read.

    \b
    Example:
      femupdate report --study house -o house.html
    """
    from femupdate.workflow.report import report_study

    with ExitStack() as stack:
        if output is None:
            study.check_writable()
            stack.enter_context(locked(study.folder, "report"))
        bars = stack.enter_context(Bars())
        return Answer(report_study(study, output, bars))
