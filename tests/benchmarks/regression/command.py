"""femupdate benchmark all."""

from pathlib import Path

import click
from femupdate.cli.common import Failure

from ..command import benchmark_options
from ..result import Job, Report


@click.command("all")
@click.option("--quick", is_flag=True, help="The cheap half of the runs, some ten minutes.")
@click.option(
    "--reference",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Figures to compare with; default: docs/results/regression.json.",
)
@click.option("--only", default="*", show_default=True, help="Names of runs, such as 'finder*'.")
@benchmark_options
def command(job: Job, quick: bool, reference: Path | None, only: str) -> Report:
    """Every command on fixed data, beside the figures of a reference file: to run before a release.

    A figure outside of its tolerance, a slower run and one with more than 2 GB are marked, and the
    exit code is then 1. Runs that are in the output folder are not made again.
    """
    from .run import REFERENCE, run_regression

    report, fallen = run_regression(job, reference or REFERENCE, quick, only)
    if fallen:
        raise Failure(f"{fallen} lines of {report.markdown} are outside of their tolerance")
    return report
