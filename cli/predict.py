"""femupdate predict and render: what follows from a posterior."""

from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import (
    Tables,
    channel_option,
    columns_options,
    drawn,
    scale_option,
    study_options,
    table_options,
    unit_option,
)
from .group import GroupedCommand
from .parameters import InputFile, Member


@click.command("predict", cls=GroupedCommand)
@click.option("--record", type=InputFile(), required=True, help="Ground motion.")
@channel_option
@unit_option
@scale_option
@click.option(
    "--damping",
    type=click.FloatRange(0.0, 1.0),
    help="Damping ratio of all modes; default: the posterior's.",
)
@click.option(
    "--samples",
    type=click.IntRange(min=2),
    default=300,
    show_default=True,
    help="Draws of the posterior whose response is computed.",
)
@click.option(
    "--measured",
    type=InputFile(),
    help="Observation file with the floors measured in the same motion.",
)
@click.option("--floor-spectra", is_flag=True, help="Also compute response spectra of the floors.")
@click.option(
    "--spectrum-damping",
    type=click.FloatRange(0.0, 1.0, max_open=True),
    default=0.05,
    show_default=True,
    help="Damping ratio of the oscillators of the spectra.",
)
@click.option(
    "--member",
    "members",
    multiple=True,
    type=Member(),
    help="Also compute member forces; may be given several times. x,y,z (m): end forces of the "
    "nearest beam or column element. LINE:STORY or LINE:FROM-TO:STORY, such as X2:Y1-Y2:S1: forces "
    "at the foot of the wall.",
)
@click.option(
    "--member-draws",
    type=click.IntRange(min=2),
    default=24,
    show_default=True,
    help="Posterior draws for which member forces are computed.",
)
@click.option(
    "--scatter",
    type=click.FloatRange(0.0, 1.0),
    show_default="as several runs differ, else .05",
    help="Scatter of stiffness between events (sd of ln).",
)
@click.option(
    "--damping-scatter",
    type=click.FloatRange(0.0, 2.0),
    show_default="likewise, else .2",
    help="Scatter of damping between events (sd of ln).",
)
@columns_options
@study_options(needs="posterior")
@table_options("prediction")
def command(
    floor_spectra: bool,
    spectrum_damping: float,
    tables: Tables,
    study: Study,
    bars: Bars,
    pictures: bool,
    **asked: Any,
) -> Answer:
    """Predict floor accelerations and story shears for a ground motion.

    Reads JMA, K-NET, PEER, CSMIP and further formats; `femupdate list` has all of them.

    \b
    Examples:
      femupdate predict --record examples/records/ridgecrest_2019_clc_90.csv --scale 0.1
      femupdate predict --record run2.csv --measured run2.csv --posterior roof
    """
    from femupdate import interface

    oscillators = spectrum_damping if floor_spectra else None
    report = interface.predict(study, progress=bars, spectrum_damping=oscillators, **asked)
    written = tables.write(study, report)
    files = [study.result("member_forces.csv")] if report.members else []
    made = drawn(report, study.result("pictures"), pictures, bars)
    return Answer(report, made, files=files, tables=written)


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
def render(
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

    The modes that move most of the mass are drawn, or those asked for. They have the numbers of
    the full model, as `femupdate build-model` lists them.

    \b
    Examples:
      femupdate render
      femupdate render --mode 3 --mode 11 --gif
    """
    from femupdate.workflow.model import open_calibrated
    from femupdate.workflow.render import render_study

    model = open_calibrated(study, bars)
    report = render_study(
        study, model, modes, samples, wanted=wanted, animated=gif, seed=seed, progress=bars
    )
    written = tables.write(study, report)
    return Answer(report, more={"study": study.folder}, tables=written)
