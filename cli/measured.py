"""femupdate inspect and identify: what measured files hold."""

from dataclasses import replace
from pathlib import Path

import click

from femupdate.errors import ReportError

from .common import (
    NEW_FILE,
    Answer,
    check_free,
    columns_options,
    no_pictures_option,
    option,
    output_option,
    overwrite_option,
    plain_options,
)
from .group import Failure, GroupedCommand
from .parameters import BAND, INPUT_FILE


@click.command("inspect", cls=GroupedCommand)
@click.argument("files", type=INPUT_FILE, nargs=-1, required=True)
@option("--unit --units", "Unit of accelerations, or of a model: N,mm.")
@option(
    "--picture",
    "Draw histories, spectra, response to the base and coherence of one file into a PNG.",
    NEW_FILE,
)
@columns_options
@plain_options
def inspect(
    files: tuple[Path, ...],
    unit: str | None,
    picture: Path | None,
    columns: dict[str, str] | None,
) -> Answer:
    """Say what is in the measured files FILES, what looks wrong, and what to run next.

    Reads tables (CSV), MATLAB and numpy files, universal files, and the records of CESMD, USGS,
    COSMOS, ESM, K-NET, JMA and PEER, also in zip and tar archives. Says as well what a model of
    Nastran, OpenSees, SAP2000 or ETABS holds; --units N,mm gives its units. Changes nothing.

    \b
    Example:
      femupdate inspect examples/six_story_white_noise.csv --picture inspected.png
    """
    from femupdate.workflow.inspect_files import draw_inspection
    from femupdate.workflow.inspect_files import inspect as inspected

    if len(files) > 1 and (picture or columns):
        raise Failure(
            "--picture draws one file, and names of channels are one file's; inspect the files one"
            " by one"
        )
    report = inspected(*files, unit=unit, columns=columns)
    pictures = None
    problems = list(report.refused)
    if picture is not None and report.files:
        try:
            pictures = (draw_inspection(report.files[0], picture),)
        except ReportError as error:  # what is in the file is said all the same
            problems.append(str(error))
    more = {"refused": report.refused}  # on stderr alone
    answer = Answer(replace(report, refused=()), more, pictures=pictures)
    if problems:
        answer.show(click.get_current_context().params["as_json"])
        raise Failure("\n".join(problems))
    return answer


@click.command("identify", cls=GroupedCommand)
@click.argument("record", type=INPUT_FILE)
@output_option("CSV file of the modes to write; a picture goes beside it.")
@columns_options
@option("--band", "Frequency range of the modes, such as 0.5,18 (Hz).", BAND)
@option("--order", "Largest order of the models.", click.IntRange(10, 120), 40)
@overwrite_option
@no_pictures_option
@plain_options
def identify(
    record: Path,
    output: Path,
    columns: dict[str, str] | None,
    band: tuple[float, float] | None,
    order: int,
    overwrite: bool,
    no_pictures: bool,
) -> Answer:
    """Identify modes from RECORD, floor motions whose excitation is unknown (ambient vibration).

    Writes frequencies, damping ratios and shapes with their standard deviations as the table that
    `femupdate calibrate` reads. Poles that do not come back from order to order are left out; the
    picture shows them. Needs the package pyOMA2: pip install 'femupdate[ambient]'.

    \b
    Examples:
      femupdate identify ambient.csv -o modes.csv
      femupdate calibrate modes.csv --building my_building.toml
    """
    from femupdate.workflow.inspect_files import identify as identified

    check_free(output, overwrite)
    report = identified(record, output, columns=columns, band_hz=band, order=order)
    if no_pictures:
        return Answer(report)
    from femupdate.report.figure import save_figure

    return Answer(report, pictures=(save_figure(report.plot(), output.with_suffix(".png")),))
