"""femupdate demo."""

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import Tables, study_options
from .help import GroupedCommand


@click.command("demo", cls=GroupedCommand)
@study_options(draws=False)
def command(study: Study, seed: int, bars: Bars) -> Answer:
    """Run the whole chain on a shipped synthetic observation and a real ground motion.

    \b
    Example:
      femupdate demo --study demo
    """
    from femupdate.workflow.demo import demo_tables, draw_demo, run_demo

    report = run_demo(study, seed, bars)
    drawn = draw_demo(study, report, bars)
    return Answer(report, drawn, tables=Tables(None).write(study, demo_tables(study, report)))
