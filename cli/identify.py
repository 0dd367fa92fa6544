"""femupdate identify."""

from pathlib import Path

import click

from .answer import Answer
from .common import Failure, columns_options, plain_options
from .help import GroupedCommand
from .parameters import Band, InputFile


@click.command("identify", cls=GroupedCommand)
@click.argument("record", type=InputFile())
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="CSV file of the modes to write; a picture goes beside it.",
)
@columns_options
@click.option("--band", type=Band(), help="Frequency range of the modes, such as 0.5,18 (Hz).")
@click.option(
    "--order",
    type=click.IntRange(10, 120),
    default=40,
    show_default=True,
    help="Largest order of the models.",
)
@click.option("--force", is_flag=True, help="Replace an existing file.")
@click.option("--no-pictures", is_flag=True, help="Draw no pictures.")
@plain_options
def command(
    record: Path,
    output: Path,
    columns: dict[str, str] | None,
    band: tuple[float, float] | None,
    order: int,
    force: bool,
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
    from femupdate.workflow.identify import draw_identified, identify

    if output.exists() and not force:
        raise Failure(f"{output} is there already; choose another name, or replace it by --force")
    found = identify(record, output, columns=columns, band_hz=band, order=order)
    if no_pictures:
        return Answer(found)
    return Answer(found, (draw_identified(found, output.with_suffix(".png")),))
