"""femupdate status, compare and report: what a study says."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from femupdate.bars import Bars
from femupdate.study import Study, locked

from .common import NEW_FILE, Answer, option, output_option, study_options
from .group import GroupedCommand
from .parameters import COLUMNS, INPUT_FILE

_reading = study_options(posterior=True, writes=False, draws=False, seeded=False)


@click.command("status", cls=GroupedCommand)
@_reading
def status(study: Study, bars: Bars) -> Answer:
    """Say what a study holds, what is stale, and what to do next. Changes nothing.

    \b
    Examples:
      femupdate status
      femupdate status --posterior roof
    """
    from femupdate.workflow.status import study_status

    return Answer(study_status(study))


@click.command("compare", cls=GroupedCommand)
@click.argument("before")
@click.argument("after")
@option("--picture", "Draw the intervals of both into a PNG.", NEW_FILE)
@option("--columns", "Column names or points of the files: ours=theirs,...", COLUMNS)
@study_options(writes=False, draws=False, seeded=False)
def compare(
    before: str, after: str, picture: Path | None, columns: Any, study: Study, bars: Bars
) -> Answer:
    """Say which stories changed from BEFORE to AFTER an event.

    Both are posteriors of one building, each from a measurement of its own. They are named as
    `femupdate calibrate --name` named them in the study, or as study folders or posterior files.
    Of two files of modes it tells which belong together, with MAC and COMAC; `femupdate render`
    writes those of a posterior, mass-normalised, to tables/shapes.csv and shapes.uff. Of two files
    of FRFs or records under base motion, or of one and a posterior, it gives FRAC by floors.
    Changes nothing.

    \b
    Examples:
      femupdate calibrate before.csv --name before
      femupdate calibrate after.csv --name after
      femupdate compare before after
      femupdate compare study/tables/shapes.csv identified.csv
      femupdate compare study obs.csv
    """
    from femupdate import interface

    report = interface.compare(study, before, after, columns=columns)
    if picture is None:
        return Answer(report)
    from femupdate.report.figure import save_figure

    return Answer(report, pictures=(save_figure(report.plot(), picture),))


@click.command("report", cls=GroupedCommand)
@output_option("HTML file to write; default report.html in the study.", required=False)
@option("--title", "Title of the page; default that of the building.")
@option("--author", "Who wrote it; stands below the title.")
@option("--client", "For whom it is; stands below the title.")
@option("--logo", "Picture beside the title, PNG or JPEG.", INPUT_FILE)
@option(
    "--add",
    "Picture (PNG, JPEG) or text (.md, .txt) as a section; may be given several times.",
    INPUT_FILE,
    multiple=True,
)
@_reading
def report(study: Study, output: Path | None, bars: Bars, **more: Any) -> Answer:
    """Write one HTML page with everything that a study says, to hand on.

    The page needs no network and nothing beside it. It shows what was done and from which files,
    the building with its modes, the data, the fit, the posterior, the prediction, what the model
    lacks, and all warnings. With --output, the study is only read.

    \b
    Examples:
      femupdate report --study house -o house.html
      femupdate report --study house --client "City of Kobe" --logo logo.png --add site.md
    """
    from femupdate.workflow.page import write_report

    if output is None:
        study.check_writable()
    with nullcontext() if output else locked(study.folder):
        return Answer(write_report(study, output, progress=bars, **more))
