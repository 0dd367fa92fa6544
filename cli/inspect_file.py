"""femupdate inspect."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from femupdate.errors import MeasurementError
from femupdate.study import Study

from .common import Failure, print_json, print_notes, study_options, table
from .parameters import InputFile

if TYPE_CHECKING:
    from femupdate.measurement.inspection import Inspection


@click.command("inspect")
@click.argument("files", type=InputFile(), nargs=-1, required=True)
@click.option("--unit", help="Unit of accelerations, where a file does not say it.")
@click.option(
    "--picture",
    type=click.Path(dir_okay=False, path_type=Path),
    help="PNG to draw: histories, spectra, response to the base, coherence. For one file.",
)
@study_options(writes=False)
def command(
    files: tuple[Path, ...],
    unit: str | None,
    picture: Path | None,
    study: Study,
    seed: int,
    as_json: bool,
) -> None:
    """Say what is in the measured files FILES, what looks wrong, and what to run next.

    Reads tables (CSV), MATLAB and numpy files, universal files, and the records of CESMD, USGS,
    COSMOS, ESM, K-NET, JMA and PEER, also in zip archives. Changes nothing.
    """
    from femupdate.measurement.inspection import inspect_file

    if picture is not None and len(files) > 1:
        raise click.UsageError("--picture draws one file; inspect the files one by one")
    found, refused = [], []
    for path in files:
        try:
            found.append(inspect_file(path, unit))
        except MeasurementError as error:
            refused.append(str(error))
    if picture is not None and found:
        _draw(found[0], picture)
    if as_json and (found or not refused):
        print_json({"files": [one.as_dict() for one in found], "refused": refused})
    elif not as_json:
        for one in found:
            _print(one)
    if refused:
        raise Failure("\n".join(refused))


def _draw(one: "Inspection", picture: Path) -> None:
    from femupdate.report.figure import save_figure
    from femupdate.report.inspected import inspection_picture

    save_figure(inspection_picture(one), picture)


def _print(one: "Inspection") -> None:
    from femupdate.measurement.inspection import function_text

    click.echo(f"{one.path}: {one.summary}")
    if one.channels:
        rows = [
            (
                f"{each.number} {each.place}",
                *(each.direction_text, each.channel.quantity, f"{1 / each.channel.time_step:g} Hz"),
                *(f"{each.channel.values.size}", f"{each.duration_s:.4g} s", each.peak_text),
            )
            for each in one.channels
        ]
        head = ("channel", "direction", "quantity", "rate", "samples", "length", "peak")
        click.echo(table(head, rows))
    for function in one.functions:
        click.echo(f"  {function_text(function)}")
    for mode in one.recording.modes:
        damping = "" if mode.damping is None else f", damping ratio {mode.damping:.4g}"
        click.echo(f"  mode at {mode.frequency_hz:.5g} Hz{damping}, {len(mode.points)} points")
    print_notes(one.recording.notes)
    click.echo("What looks wrong:" if one.all_findings else "Nothing looks wrong.")
    print_notes(one.all_findings)
    click.echo(f"Next: {one.step.command or one.step.advice}")
    if one.step.command and one.step.advice:
        click.echo(f"  {one.step.advice}")
