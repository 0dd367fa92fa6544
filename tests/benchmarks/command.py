"""What the commands of all benchmarks share."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from femupdate.cli.answer import Answer
from femupdate.cli.bars import Bars
from femupdate.cli.common import running

from .result import Job, Report


def benchmark_options(function: Callable[..., Report]) -> Callable[..., None]:
    """Add --output, --seed, --json and -v to a function of a `Job`, and print its report.

    Errors of the library end the command with exit code 1.
    """

    @click.option(
        "--output",
        "output_folder",
        type=click.Path(file_okay=False, path_type=Path),
        default=Path("benchmarks"),
        show_default=True,
        help="Folder for the results.",
    )
    @running
    @functools.wraps(function)
    def run(output_folder: Path, seed: int, as_json: bool, **options: Any) -> None:
        with Bars() as bars:
            report = function(Job(output_folder, seed, bars), **options)
        Answer(report, report.pictures or None, files=report.files).show(as_json)

    return run
