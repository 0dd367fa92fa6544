"""femupdate predict."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import Tables, columns_options, study_options, table_options
from .help import GroupedCommand
from .parameters import Channel, InputFile, Member


@click.command("predict", cls=GroupedCommand)
@click.option("--record", type=InputFile(), required=True, help="Ground motion.")
@click.option("--channel", type=Channel(), help="Channel of the record, by name or number.")
@click.option("--unit", help="Unit of the accelerations, where the file gives none.")
@click.option("--scale", type=float, default=1.0, show_default=True, help="Factor on the record.")
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
    record: Path,
    channel: int | str | None,
    unit: str | None,
    scale: float,
    measured: Path | None,
    columns: dict[str, str] | None,
    floor_spectra: bool,
    spectrum_damping: float,
    tables: Tables,
    study: Study,
    bars: Bars,
    pictures: bool,
    **settings: Any,
) -> Answer:
    """Predict floor accelerations and story shears for a ground motion.

    Reads JMA, K-NET, PEER, CSMIP and further formats; `femupdate list` has all of them.

    \b
    Examples:
      femupdate predict --record examples/records/ridgecrest_2019_clc_90.csv --scale 0.1
      femupdate predict --record run2.csv --measured run2.csv --posterior roof
    """
    from femupdate.workflow.checks import open_calibrated
    from femupdate.workflow.predict import predict_study
    from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource
    from femupdate.workflow.result_tables import prediction_tables

    oscillators = spectrum_damping if floor_spectra else None
    report = predict_study(
        study,
        open_calibrated(study, bars),
        RecordSource(record, unit, channel, scale),
        PredictionSettings(spectrum_damping=oscillators, **settings),
        measured=measured,
        columns=columns,
        progress=bars,
    )
    written = tables.write(study, prediction_tables(report))
    files = [study.result("member_forces.csv")] if report.members else []
    if not pictures:
        return Answer(report, (), files=files, tables=written)
    from femupdate.workflow.pictures_prediction import draw_prediction

    return Answer(report, draw_prediction(study, report, bars), files=files, tables=written)
