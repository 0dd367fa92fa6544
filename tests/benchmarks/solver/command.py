"""femupdate benchmark solver."""

from pathlib import Path

import click
from femupdate.cli.answer import print_json, print_pictures
from femupdate.cli.bars import Bars
from femupdate.cli.common import benchmark_options
from femupdate.cli.parameters import Names

from femupdate.tables import table


@click.command("solver")
@click.option(
    "--sizes",
    type=Names(),
    default="small",
    show_default=True,
    help="Of the building of the speed comparison: small, medium, large with commas (1,680, 8,640 "
    'and 31,110 shells; seconds, minutes and a quarter of an hour), or "" for none.',
)
@benchmark_options
def command(sizes: tuple[str, ...], output_folder: Path, seed: int, as_json: bool) -> None:
    """Element tests against published values; speed against OpenSees."""
    from .elements import SCORE_HEAD, score_record, score_rows
    from .run import run_solver_benchmark, speed_record
    from .speed import SPEED_HEAD, speed_rows

    with Bars() as bars:
        report = run_solver_benchmark(output_folder, sizes, seed, bars)
    reached = sum(score.reached for score in report.scores)
    if as_json:
        print_json(
            {
                "machine": report.machine.sentence(),
                "elements": [score_record(score) for score in report.scores],
                "elements_reached": reached,
                "speed": [speed_record(row) for row in report.speed],
                "results": [report.files.json, report.files.markdown],
                "pictures": report.pictures,
            }
        )
        return
    click.echo(table(SCORE_HEAD, score_rows(report.scores)))
    click.echo(f"{reached} of {len(report.scores)} rows within 2 % of the best other element")
    if report.speed:
        click.echo(table(SPEED_HEAD, speed_rows(report.speed)))
    click.echo("\n".join(f"  - {note}" for note in report.notes))
    print_pictures((report.files.json, report.files.markdown, *report.pictures))
