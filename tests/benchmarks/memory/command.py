"""femupdate benchmark memory."""

import click
from femupdate.cli.common import Failure

from ..command import benchmark_options
from ..result import Job, Report


@click.command("memory")
@click.option("--only", default="*", show_default=True, help="Names of commands, such as 'dia*'.")
@benchmark_options
def command(job: Job, only: str) -> Report:
    """Largest memory of every command on the six-story study, with its workers.

    A command with more than 2 GB is marked, and the exit code is then 1. Commands that were
    measured into the output folder are not run again.
    """
    from .run import run_memory

    report, over = run_memory(job, only)
    if over:
        raise Failure(f"{over} commands in {report.markdown} take more than they may")
    return report
