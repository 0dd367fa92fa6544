"""femupdate build-model."""

from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import study_options
from .help import GroupedCommand
from .parameters import BuildingName


@click.command("build-model", cls=GroupedCommand)
@click.argument("building", type=BuildingName(), required=False)
@click.option(
    "--export",
    type=click.Choice(["opensees"]),
    help="Also write the model for another program: a script for OpenSeesPy.",
)
@click.option(
    "--shell",
    type=click.Choice(["ASDShellQ4", "ShellMITC4", "ShellDKGQ"]),
    default="ASDShellQ4",
    show_default=True,
    help="Shell element of the exported script.",
)
@study_options(shares=True)
def command(
    building: str | None,
    export: str | None,
    shell: Any,
    study: Study,
    seed: int,
    bars: Bars,
    pictures: bool,
) -> Answer:
    """Build the model of BUILDING: mesh, checks, modes, pictures, reduced model.

    BUILDING is a TOML file or the name of a shipped building. The default is the building of the
    study, or six_story_wall_frame in a new study.

    \b
    Examples:
      femupdate build-model six_story_wall_frame
      femupdate build-model my_building.toml --study mine
    """
    from femupdate.workflow.build import build_study, export_opensees
    from femupdate.workflow.pictures_modes import draw_model

    report = build_study(study, building, bars)
    drawn = draw_model(study, report.model, report.modes, bars) if pictures else ()
    files = [export_opensees(study, report.model.building, shell=shell)] if export else []
    return Answer(report, drawn, {"exported": files, "study": study.folder}, files)
