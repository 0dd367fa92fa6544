"""femupdate build-model."""

from typing import Any

import click

from femupdate.study import Study

from .common import Bars, print_json, print_notes, print_pictures, study_options, table
from .parameters import BuildingName


@click.command("build-model")
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
@study_options()
def command(
    building: str | None,
    export: str | None,
    shell: Any,
    study: Study,
    seed: int,
    as_json: bool,
) -> None:
    """Build the model of BUILDING: mesh, checks, modes, pictures, reduced model.

    BUILDING is a TOML file or the name of a shipped building. The default is the building of the
    study, or six_story_wall_frame in a new study.
    """
    from femupdate.workflow.build import build_study

    with Bars() as bars:
        report = build_study(study, building, bars)
    files = []
    if export == "opensees":
        from femupdate.workflow.export import export_opensees

        files.append(export_opensees(study, report.model.building, shell=shell))
    if as_json:
        print_json(
            {
                "building": report.model.building.name,
                "frequencies_hz": report.frequencies_hz,
                "effective_mass": report.effective_mass,
                "dof": report.dof,
                "elements": report.elements,
                "mass_kg": report.mass_kg,
                "reduced_size": report.model.reduced.size,
                "reduction_error": report.model.reduction_error,
                "checks": report.checks,
                "pictures": report.pictures,
                "exported": files,
                "study": study.folder,
            }
        )
        return
    click.echo(f"{report.model.building.title or report.model.building.name}")
    click.echo(f"  {report.dof} degrees of freedom, {report.elements} elements")
    rows = [
        (str(number), f"{frequency:.3f}", f"{share:.1%}")
        for number, (frequency, share) in enumerate(
            zip(report.frequencies_hz, report.effective_mass, strict=True), start=1
        )
    ]
    click.echo(table(("mode", "Hz", "mass moved by the base motion"), rows))
    print_notes(report.checks)
    print_pictures((*report.pictures, *files))
