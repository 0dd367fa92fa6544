"""femupdate build-model."""

from pathlib import Path

import click

from .common import Bars, print_json, print_notes, print_pictures, shared_options, table


@click.command("build-model")
@click.argument("building", required=False)
@shared_options
def command(building: str | None, study_folder: Path, seed: int, as_json: bool) -> None:
    """Build the model of BUILDING: mesh, checks, modes, pictures, reduced model.

    BUILDING is a TOML file or the name of a shipped building; default: the study's own, or
    six_story_wall_frame for a new study.
    """
    from femupdate.study import Study
    from femupdate.workflow.build import build_study
    from femupdate.workflow.checks import check_writable

    study = Study(study_folder)
    check_writable(study)
    with Bars() as bars:
        report = build_study(study, building, bars)
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
                "study": study_folder,
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
    print_pictures(report.pictures)
