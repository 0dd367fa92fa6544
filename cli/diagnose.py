"""femupdate diagnose."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import Tables, noticed_options, reading_options, study_options, table_options
from .help import GroupedCommand
from .parameters import BuildingName, InputFile


@click.command("diagnose", cls=GroupedCommand)
@click.argument("observations", type=InputFile(), nargs=-1, required=True)
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option("--second", type=InputFile(), help="Second record at another level of motion.")
@click.option("--no-phase", is_flag=True, help="Use the amplitude alone.")
@click.option(
    "--sampled",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Leading effects whose evidence is sampled instead of approximated.",
)
@noticed_options
@reading_options
@study_options(shares=True)
@table_options("diagnosis")
def command(
    observations: tuple[Path, ...],
    building: str | None,
    second: Path | None,
    no_phase: bool,
    sampled: int,
    noticed: dict[str, Any],
    reading: dict[str, Any],
    tables: Tables,
    study: Study,
    seed: int,
    bars: Bars,
    pictures: bool,
) -> Answer:
    """Find where the model and the measured files OBSERVATIONS disagree, and what is missing.

    Every effect of the catalogue is tested at every place. The leading ones are fitted, and their
    evidence is weighed. Nothing is changed: `femupdate repair` adds what was found. Files are of
    any kind that `calibrate` takes, alone or together: histories and FRFs under base motion, FRFs
    under a force, identified modes.

    \b
    Examples:
      femupdate diagnose examples/six_story_white_noise.csv
      femupdate diagnose run1.csv --second stronger_run.csv
      femupdate diagnose hammer.csv modes.csv
    """
    from femupdate.discrepancy.thresholds import DiagnosisSettings
    from femupdate.workflow.checks import readable
    from femupdate.workflow.diagnose import diagnose_study
    from femupdate.workflow.model import open_study
    from femupdate.workflow.result_tables import diagnosis_tables

    source = readable(reading, *observations)
    other = None if second is None else readable(reading, second)
    model = open_study(study, building, bars)
    settings = DiagnosisSettings(seed=seed, sampled=sampled, **noticed)
    report = diagnose_study(study, model, source, settings, bars, not no_phase, other)
    more, written = {"diagnosis": report.path}, tables.write(study, diagnosis_tables(report))
    if not pictures:
        return Answer(report, (), more, tables=written)
    from femupdate.workflow.pictures_discrepancy import draw_diagnosis

    return Answer(report, draw_diagnosis(study, report), more, tables=written)
