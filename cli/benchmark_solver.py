"""femupdate benchmark solver."""

from pathlib import Path

import click

from .common import Bars, benchmark_options, print_json, print_pictures, table


@click.command("solver")
@benchmark_options
def command(output_folder: Path, seed: int, as_json: bool) -> None:
    """Element tests against published values; speed against OpenSees."""
    from femupdate.benchmark.elements import SCORE_HEAD, score_record, score_rows
    from femupdate.benchmark.solver import run_solver_benchmark

    with Bars() as bars:
        report = run_solver_benchmark(output_folder, seed, bars)
    reached = sum(score.reached for score in report.scores)
    if as_json:
        print_json(
            {
                "machine": report.machine.sentence(),
                "elements": [score_record(score) for score in report.scores],
                "elements_reached": reached,
                "results": [report.files.json, report.files.markdown],
                "pictures": report.pictures,
            }
        )
        return
    click.echo(table(SCORE_HEAD, score_rows(report.scores)))
    click.echo(f"{reached} of {len(report.scores)} rows within 2 % of the best other element")
    print_pictures((report.files.json, report.files.markdown, *report.pictures))
