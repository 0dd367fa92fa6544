"""femupdate list, examples and demo: what comes with the program."""

from pathlib import Path

import click

from femupdate.bars import Bars
from femupdate.study import Study

from .common import Answer, plain_options, study_options
from .group import GroupedCommand


@click.command("list", cls=GroupedCommand)
@plain_options
def listing() -> Answer:
    """List shipped buildings, effects with their places and units, and formats of measured files.

    Buildings go by their name wherever a building file is taken.

    \b
    Example:
      femupdate list
    """
    from femupdate.workflow.shipped import list_all

    return Answer(list_all())


@click.command("examples", cls=GroupedCommand)
@click.argument("folder", type=click.Path(path_type=Path), default="examples")
@plain_options
def examples(folder: Path) -> Answer:
    """Copy the shipped example and building files into FOLDER, by default ./examples.

    Files that are there already stay as they are.

    \b
    Examples:
      femupdate examples
      femupdate calibrate examples/run1.csv --building shear_4dof
    """
    from femupdate.workflow.shipped import copy_examples

    return Answer(copy_examples(folder))


@click.command("demo", cls=GroupedCommand)
@study_options(draws=False)
def demo(study: Study, seed: int, bars: Bars) -> Answer:
    """Run the whole chain on a shipped synthetic observation and a real ground motion.

    \b
    Example:
      femupdate demo --study demo
    """
    from femupdate.report.figure import draw
    from femupdate.workflow.demo import run_demo

    report = run_demo(study, seed=seed, progress=bars)
    drawn = draw(report, study.path("pictures"), bars)
    modes = tuple(mode["picture"] for mode in report.parts[-1].as_dict()["modes"])
    return Answer(report, pictures=(*drawn, *map(Path, modes)))
