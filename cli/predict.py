"""femupdate predict."""

from pathlib import Path

import click

from femupdate.study import Study

from .common import (
    Bars,
    print_json,
    print_notes,
    print_pictures,
    study_options,
    table,
)
from .parameters import Channel, Columns, InputFile, Member, Place


@click.command("predict")
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
    help="Posterior draws that are integrated.",
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
    "--columns", type=Columns(), help="Column names of the measured file: ours=theirs,..."
)
@study_options(needs="posterior")
def command(
    record: Path,
    channel: int | str | None,
    unit: str | None,
    scale: float,
    damping: float | None,
    samples: int,
    measured: Path | None,
    floor_spectra: bool,
    spectrum_damping: float,
    members: tuple[Place | str, ...],
    member_draws: int,
    columns: dict[str, str] | None,
    study: Study,
    seed: int,
    as_json: bool,
) -> None:
    """Predict floor accelerations and story shears for a ground motion.

    Reads JMA CSV, K-NET, PEER AT2, CSMIP V1 and V2, and plain two-column files.
    """
    from femupdate.workflow.checks import open_calibrated
    from femupdate.workflow.predict import predict_study
    from femupdate.workflow.predict_settings import PredictionSettings, RecordSource

    with Bars() as bars:
        report = predict_study(
            study,
            open_calibrated(study, bars),
            RecordSource(record, unit, channel, scale),
            PredictionSettings(
                samples,
                damping,
                seed,
                spectrum_damping if floor_spectra else None,
                members,
                member_draws,
            ),
            measured=measured,
            columns=columns,
            progress=bars,
        )
    floors = report.summary.floors
    peaks, stiffness = report.peak_acceleration, report.story_stiffness
    comparison = report.comparison
    if as_json:
        content = {
            "prediction": report.path,
            "floors": floors,
            "peak_acceleration_m_s2": {
                floor: {"mean": m, "q05": a, "q95": b}
                for floor, m, a, b in zip(floors, peaks.mean, peaks.q05, peaks.q95, strict=True)
            },
            "story_stiffness_n_per_m": {
                str(story): {"mean": m, "q05": a, "q95": b}
                for story, (m, a, b) in enumerate(
                    zip(stiffness.mean, stiffness.q05, stiffness.q95, strict=True), start=1
                )
            },
            "damping": report.damping,
            "notes": report.notes,
            "pictures": report.pictures,
            "seconds": report.seconds,
        }
        if comparison is not None:
            content["comparison"] = {
                floor: {
                    "relative_error": comparison.relative_error[k],
                    "correlation": comparison.correlation[k],
                    "peak_ratio": comparison.peak_ratio[k],
                    "within_band": comparison.within_band[k],
                }
                for k, floor in enumerate(comparison.floors)
            }
        if report.members:
            content["member_forces"] = [
                {
                    "kind": m.member.kind,
                    "name": m.member.name,
                    "ends_m": m.member.ends,
                    "peak_n": m.named(m.peak.mean),
                    "peak_q05_n": m.named(m.peak.q05),
                    "peak_q95_n": m.named(m.peak.q95),
                }
                for m in report.members
            ]
        spectra = report.floor_spectra
        if spectra is not None:
            of_floors = spectra.acceleration
            content["floor_spectra"] = {
                "frequency_hz": spectra.frequency_hz,
                "damping": spectra.damping,
                "base_m_s2": spectra.base,
                "floors_m_s2": {
                    floor: {
                        "mean": of_floors.mean[k],
                        "q05": of_floors.q05[k],
                        "q95": of_floors.q95[k],
                    }
                    for k, floor in enumerate(floors)
                },
            }
        print_json(content)
        return
    click.echo(f"Prediction from {len(report.summary)} posterior draws, {report.seconds:.1f} s")
    click.echo(f"  damping ratio: {report.damping}")
    rows = [
        (floor, *(f"{v:.3f}" for v in values))
        for floor, *values in zip(floors, peaks.mean, peaks.q05, peaks.q95, strict=True)
    ]
    click.echo(table(("peak m/s2", "mean", "5 %", "95 %"), rows))
    rows = [
        (f"story {story}", *(f"{v:.4g}" for v in values))
        for story, values in enumerate(
            zip(stiffness.mean, stiffness.q05, stiffness.q95, strict=True), start=1
        )
    ]
    click.echo(table(("stiffness N/m", "mean", "5 %", "95 %"), rows))
    for number, found in enumerate(report.members, start=1):
        member, peak = found.member, found.peak
        rows = [
            (name.replace("_", " "), *(f"{v:.4g}" for v in values))
            for name, *values in zip(member.forces, peak.mean, peak.q05, peak.q95, strict=True)
        ]
        click.echo(f"{member.kind} {number}, {member.name}: largest forces, N and N m")
        click.echo(table(("", "mean", "5 %", "95 %"), rows))
    if report.floor_spectra is not None:
        spectra = report.floor_spectra
        at = spectra.acceleration.mean.argmax(axis=1)
        heights = [
            (
                floor,
                f"{spectra.acceleration.mean[k, at[k]]:.3f}",
                f"{spectra.frequency_hz[at[k]]:.3g}",
            )
            for k, floor in enumerate(floors)
        ]
        click.echo(table((f"spectrum, {spectra.damping:.0%}", "peak m/s2", "at Hz"), heights))
    if comparison is not None:
        rows = [
            (
                floor,
                f"{comparison.relative_error[k]:.3f}",
                f"{comparison.correlation[k]:.3f}",
                f"{comparison.peak_ratio[k]:.3f}",
                f"{comparison.within_band[k]:.1%}",
            )
            for k, floor in enumerate(comparison.floors)
        ]
        head = ("against measured", "error rms", "correlation", "peak ratio", "within 2 sd")
        click.echo(table(head, rows))
    print_notes(report.notes)
    print_pictures((report.path, *report.pictures))
