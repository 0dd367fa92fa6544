"""femupdate inspect."""

from pathlib import Path

import click

from femupdate.errors import ReportError

from .answer import Answer
from .common import Failure, columns_options, plain_options
from .help import GroupedCommand
from .parameters import InputFile


@click.command("inspect", cls=GroupedCommand)
@click.argument("files", type=InputFile(), nargs=-1, required=True)
@click.option("--unit", help="Unit of the accelerations, where a file gives none.")
@click.option(
    "--picture",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw histories, spectra, response to the base and coherence of one file into a PNG.",
)
@click.option(
    "--write-mapping",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the proposed floors of one file's channels as TOML, for --mapping.",
)
@columns_options
@plain_options
def command(
    files: tuple[Path, ...],
    unit: str | None,
    picture: Path | None,
    write_mapping: Path | None,
    columns: dict[str, str] | None,
) -> Answer:
    """Say what is in the measured files FILES, what looks wrong, and what to run next.

    Reads tables (CSV), MATLAB and numpy files, universal files, and the records of CESMD, USGS,
    COSMOS, ESM, K-NET, JMA and PEER, also in zip and tar archives. Changes nothing.

    \b
    Example:
      femupdate inspect examples/six_story_white_noise.csv --picture inspected.png
    """
    from femupdate.workflow.inspect_files import draw_inspection, inspect_files, propose_mapping

    if len(files) > 1 and (picture or write_mapping or columns):
        raise click.UsageError(
            "--picture draws one file, and names of channels are one file's; inspect the files one"
            " by one"
        )
    if write_mapping is not None and write_mapping.exists():
        raise Failure(f"{write_mapping} is there already; choose another name, or remove it")
    found = inspect_files(files, unit, columns)
    pictures = None
    problems = list(found.refused)
    if picture is not None and found.files:
        try:
            pictures = (draw_inspection(found.files[0], picture),)
        except ReportError as error:  # what is in the file is said all the same
            problems.append(str(error))
    written = []
    if write_mapping is not None and found.files:
        written.append(propose_mapping(found.files[0], write_mapping, unit))
    answer = Answer(found, pictures, files=written)
    if problems:
        if found.files:
            answer.show(click.get_current_context().params["as_json"])
        raise Failure("\n".join(problems))
    return answer
