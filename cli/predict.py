"""femupdate predict and render: what follows from a posterior."""

from typing import Any

import click

from femupdate import Study
from femupdate.bars import Bars

from .common import (
    Answer,
    channel_option,
    columns_options,
    flag,
    option,
    scale_option,
    study_options,
    unit_option,
)
from .group import GroupedCommand
from .parameters import INPUT_FILE, MEMBER


@click.command("predict", cls=GroupedCommand)
@option("--record", "Ground motion.", INPUT_FILE, required=True)
@channel_option
@unit_option
@scale_option
@option(
    "--damping", "Damping ratio of all modes; default: the posterior's.", click.FloatRange(0.0, 1.0)
)
@option("--samples", "Draws of the posterior whose response is computed.", click.IntRange(2), 300)
@option("--measured", "Observation file with the floors measured in the same motion.", INPUT_FILE)
@flag("--floor-spectra", "Also compute response spectra of the floors.")
@option(
    "--spectrum-damping",
    "Damping ratio of the oscillators of the spectra.",
    click.FloatRange(0.0, 1.0, max_open=True),
    0.05,
)
@option(
    "--member members",
    "Also compute member forces; may be given several times. x,y,z (m): end forces of the "
    "nearest beam, column or brace. LINE:STORY or LINE:FROM-TO:STORY, such as X2:Y1-Y2:S1: forces "
    "at the foot of the wall.",
    MEMBER,
    multiple=True,
)
@option(
    "--member-draws", "Posterior draws for which member forces are computed.", click.IntRange(2), 24
)
@option(
    "--scatter",
    "Scatter of stiffness between events (sd of ln).",
    click.FloatRange(0.0, 1.0),
    show_default="as several runs differ, else .05",
)
@option(
    "--damping-scatter",
    "Scatter of damping between events (sd of ln).",
    click.FloatRange(0.0, 2.0),
    show_default="likewise, else .2",
)
@columns_options
@study_options(needs="posterior")
def command(
    floor_spectra: bool, spectrum_damping: float, study: Study, bars: Bars, **asked: Any
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
    return Answer(report, files=(study.result("member_forces.csv"),) if report.members else ())


@click.command("render", cls=GroupedCommand)
@option("--modes", "Number of modes.", click.IntRange(1, 12), 3)
@option(
    "--mode wanted",
    "Number of a mode, as build-model lists it, to draw instead; may be given several times.",
    click.IntRange(1),
    multiple=True,
)
@option(
    "--samples", "Draws of the posterior over which shapes are averaged.", click.IntRange(5), 60
)
@study_options(needs="posterior", draws=False)
def render(study: Study, bars: Bars, **asked: Any) -> Answer:
    """Draw the mode shapes of the posterior off screen: mean shape and its spread.

    Their mass-normalised values at the floors go to tables/shapes.csv and shapes.uff. The modes
    that move most of the mass are drawn, or those asked for. They have the numbers of
    the full model, as `femupdate build-model` lists them.

    \b
    Examples:
      femupdate render
      femupdate render --mode 3 --mode 11
    """
    from femupdate.workflow.render import render_study

    return Answer(render_study(study, progress=bars, **asked), {"study": study.folder})
