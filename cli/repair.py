"""femupdate repair."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .common import (
    Bars,
    print_json,
    print_pictures,
    reading_options,
    study_options,
)
from .parameters import BuildingName, InputFile


@click.command("repair")
@click.argument("observation", type=InputFile())
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option("--holdout", type=InputFile(), help="Data that are only predicted, before and after.")
@click.option(
    "--second",
    type=InputFile(),
    help="Second record at another level of motion.",
)
@click.option("--no-phase", is_flag=True, help="Use the amplitude alone.")
@reading_options
@study_options()
def command(
    observation: Path,
    building: str | None,
    holdout: Path | None,
    second: Path | None,
    no_phase: bool,
    reading: dict[str, Any],
    study: Study,
    seed: int,
    as_json: bool,
) -> None:
    """Add to the model what the measured file OBSERVATION shows to be missing.

    At most three effects are added, each only on clear evidence. The repaired building is a study
    of its own in the folder `repaired` of this study. Every command takes it.
    """
    from femupdate.discrepancy.diagnose import DiagnosisSettings
    from femupdate.workflow.model import open_study
    from femupdate.workflow.observed import ObservationSource, check_readable
    from femupdate.workflow.repair import repair_study

    source = ObservationSource(observation, **reading)
    other, more = (
        None if path is None else ObservationSource(path, **reading) for path in (holdout, second)
    )
    with Bars() as bars:
        for given in (source, other, more):
            if given is not None:
                check_readable(given)
        model = open_study(study, building, bars)
        settings = DiagnosisSettings(seed=seed)
        report = repair_study(study, model, source, other, settings, bars, not no_phase, more)
    if as_json:
        print_json({**report.as_dict(), "repair": report.path, "pictures": report.pictures})
        return
    done, points = report.repair, report.problem.effective
    for number, one in enumerate(done.rounds, start=1):
        found = one.finding
        click.echo(
            f"{number}. {found.placed.effect.title} at {found.placed.place}, size "
            f"{found.size:.4g} +- {found.size_sd:.2g}: residuals {one.chi2_before:.0f} -> "
            f"{one.chi2_after:.0f} over {points:.0f} independent points"
        )
    if not done.rounds:
        click.echo(f"Nothing was added ({done.last.verdict}). {done.last.sentence}")
    else:
        rest = "noise" if done.p_after > 0.05 else done.last.verdict
        click.echo(f"  what is left: {rest}. p-value {done.p_before:.2g} -> {done.p_after:.2g}")
    before, after = report.theta_before, report.theta_after
    for k in range(before.shape[1]):
        click.echo(
            f"  theta_{k + 1}  {before[:, k].mean():.3f} +- {before[:, k].std():.3f}  ->  "
            f"{after[:, k].mean():.3f} +- {after[:, k].std():.3f}"
        )
    held = report.held
    if held is not None:
        histories = ""
        if held.time is not None:
            histories = (
                f"error of the histories {held.error_before:.3f} -> {held.error_after:.3f}, "
            )
        click.echo(
            f"  {held.name}, kept out: {histories}of ln|H| (chi2 a point) "
            f"{held.chi2_before:.1f} -> {held.chi2_after:.1f}"
        )
    if report.building_path is not None:
        click.echo(f"  repaired building {report.building_path}")
    print_pictures((report.path, *report.pictures))
