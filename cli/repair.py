"""femupdate repair."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import noticed_options, reading_options, study_options
from .help import GroupedCommand
from .parameters import BuildingName, InputFile


@click.command("repair", cls=GroupedCommand)
@click.argument("observations", type=InputFile(), nargs=-1, required=True)
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option("--holdout", type=InputFile(), help="Data that are only predicted, before and after.")
@click.option("--second", type=InputFile(), help="Second record at another level of motion.")
@click.option("--no-phase", is_flag=True, help="Use the amplitude alone.")
@noticed_options
@reading_options
@study_options(shares=True)
def command(
    observations: tuple[Path, ...],
    building: str | None,
    holdout: Path | None,
    second: Path | None,
    no_phase: bool,
    noticed: dict[str, Any],
    reading: dict[str, Any],
    study: Study,
    seed: int,
    bars: Bars,
    pictures: bool,
) -> Answer:
    """Add to the model what the measured files OBSERVATIONS show to be missing.

    At most four effects are added, each only on clear evidence. The repaired building is a study
    of its own in the folder `repaired` of this study. Every command takes it. Files are of any
    kind that `calibrate` takes, alone or together.

    \b
    Examples:
      femupdate repair run1.csv --holdout run2.csv
      femupdate report --study study/repaired
    """
    from femupdate.discrepancy.thresholds import DiagnosisSettings
    from femupdate.workflow.checks import readable
    from femupdate.workflow.model import open_study
    from femupdate.workflow.repair import repair_study

    source = readable(reading, *observations)
    other = None if holdout is None else readable(reading, holdout)
    more = None if second is None else readable(reading, second)
    model = open_study(study, building, bars)
    settings = DiagnosisSettings(seed=seed, **noticed)
    report = repair_study(study, model, source, other, settings, bars, not no_phase, more)
    if not pictures:
        return Answer(report, (), {"repair": report.path})
    from femupdate.workflow.pictures_discrepancy import draw_repair

    return Answer(report, draw_repair(study, report), {"repair": report.path})
