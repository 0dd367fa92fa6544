"""femupdate diagnose."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femupdate.study import Study

from .common import (
    Bars,
    print_json,
    print_notes,
    print_pictures,
    reading_options,
    study_options,
    table,
)
from .parameters import BuildingName, InputFile

if TYPE_CHECKING:
    from femupdate.discrepancy.evidence import Evidence

_SHOWN = 6


def _evidence(found: "Evidence") -> str:
    error = f" +- {found.error:.2g}" if found.effective else ""
    return f"{found.log_evidence:.1f}{error}"


@click.command("diagnose")
@click.argument("observation", type=InputFile())
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option(
    "--second",
    type=InputFile(),
    help="Second record at another level of motion.",
)
@click.option("--no-phase", is_flag=True, help="Use the amplitude alone.")
@click.option(
    "--sampled",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Leading effects whose evidence is sampled instead of approximated.",
)
@reading_options
@study_options()
def command(
    observation: Path,
    building: str | None,
    second: Path | None,
    no_phase: bool,
    sampled: int,
    reading: dict[str, Any],
    study: Study,
    seed: int,
    as_json: bool,
) -> None:
    """Find where the model and the measured file OBSERVATION disagree, and what is missing.

    Every effect of the catalogue is tested at every place. The leading ones are fitted, and their
    evidence is weighed. Nothing is changed: `femupdate repair` adds what was found.
    """
    from femupdate.discrepancy.diagnose import DiagnosisSettings
    from femupdate.workflow.diagnose import diagnose_study
    from femupdate.workflow.model import open_study
    from femupdate.workflow.observed import ObservationSource, check_readable

    source = ObservationSource(observation, **reading)
    more = None
    if second is not None:
        more = ObservationSource(second, **reading)
    with Bars() as bars:
        for given in (source, more):
            if given is not None:
                check_readable(given)
        model = open_study(study, building, bars)
        settings = DiagnosisSettings(seed=seed, sampled=sampled)
        report = diagnose_study(study, model, source, settings, bars, not no_phase, more)
    if as_json:
        print_json({**report.as_dict(), "diagnosis": report.path, "pictures": report.pictures})
        return
    found = report.diagnosis
    click.echo(f"Verdict: {found.verdict}. {found.sentence}")
    click.echo(
        f"  residuals {found.base.chi2:.0f} over {report.problem.effective:.0f} independent points"
        f" (p-value {found.p_value:.2g}); {report.seconds:.1f} s"
    )
    rows = [
        (
            one.placed.label,
            _evidence(one.evidence),
            f"{one.probability:.3f}",
            f"{one.size:.4g} +- {one.size_sd:.2g}",
            f"{one.score.absorbed:.0%}",
        )
        for one in found.findings[:_SHOWN]
    ]
    if rows:
        head = ("effect", "log evidence", "probability", "size", "absorbed by theta")
        click.echo(table(head, rows))
    if found.hidden:
        click.echo(f"  cannot be seen with these sensors: {', '.join(found.hidden)}")
    print_notes((*report.would_decide, *report.screen))
    print_pictures((report.path, *report.pictures))
