"""femupdate inspect."""

from pathlib import Path

import click

from .answer import Answer
from .common import Failure, plain_options
from .parameters import InputFile


@click.command("inspect")
@click.argument("files", type=InputFile(), nargs=-1, required=True)
@click.option("--unit", help="Unit of the accelerations, where a file gives none.")
@click.option(
    "--picture",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw histories, spectra, response to the base and coherence of one file into a PNG.",
)
@plain_options
def command(files: tuple[Path, ...], unit: str | None, picture: Path | None) -> Answer:
    """Say what is in the measured files FILES, what looks wrong, and what to run next.

    Reads tables (CSV), MATLAB and numpy files, universal files, and the records of CESMD, USGS,
    COSMOS, ESM, K-NET, JMA and PEER, also in zip archives. Changes nothing.
    """
    from femupdate.workflow.inspect_files import draw_inspection, inspect_files

    if picture is not None and len(files) > 1:
        raise click.UsageError("--picture draws one file; inspect the files one by one")
    found = inspect_files(files, unit)
    pictures = None
    if picture is not None and found.files:
        pictures = (draw_inspection(found.files[0], picture),)
    answer = Answer(found, pictures)
    if found.refused:
        if found.files:
            answer.show(click.get_current_context().params["as_json"])
        raise Failure("\n".join(found.refused))
    return answer
