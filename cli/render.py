"""femupdate render."""

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import Tables, study_options, table_options
from .help import GroupedCommand


@click.command("render", cls=GroupedCommand)
@click.option(
    "--modes", type=click.IntRange(1, 12), default=3, show_default=True, help="Number of modes."
)
@click.option(
    "--mode",
    "wanted",
    type=click.IntRange(min=1),
    multiple=True,
    help="Number of a mode, as build-model lists it, to draw instead; may be given several times.",
)
@click.option(
    "--samples",
    type=click.IntRange(min=5),
    default=60,
    show_default=True,
    help="Draws of the posterior over which shapes are averaged.",
)
@click.option("--gif", is_flag=True, help="Also write the modes as animated GIF files.")
@study_options(needs="posterior", draws=False)
@table_options("modes")
def command(
    modes: int,
    wanted: tuple[int, ...],
    samples: int,
    gif: bool,
    tables: Tables,
    study: Study,
    seed: int,
    bars: Bars,
) -> Answer:
    """Draw the mode shapes of the posterior off screen: mean shape and its spread.

    The modes that matter most to the data come first, or those asked for are drawn. They have
    the numbers of the full model, as `femupdate build-model` lists them.

    \b
    Examples:
      femupdate render
      femupdate render --mode 3 --mode 11 --gif
    """
    from femupdate.workflow.checks import open_calibrated
    from femupdate.workflow.render import render_study
    from femupdate.workflow.result_tables import mode_tables

    model = open_calibrated(study, bars)
    report = render_study(
        study, model, modes, samples, wanted=wanted, animated=gif, seed=seed, progress=bars
    )
    written = tables.write(study, mode_tables(report))
    return Answer(report, more={"study": study.folder}, tables=written)
