"""femupdate calibrate."""

from pathlib import Path
from typing import Any

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


@click.command("calibrate")
@click.argument("observations", type=InputFile(), nargs=-1, required=True)
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option("--exact", is_flag=True, help="Sample the likelihood of the data themselves.")
@click.option(
    "--particles",
    type=click.IntRange(min=200),
    default=5000,
    show_default=True,
    help="Number of posterior draws.",
)
@click.option(
    "--chains",
    type=click.IntRange(min=1),
    default=4,
    show_default=True,
    help="Independent sampler runs.",
)
@click.option("--device", default="cpu", show_default=True, help="Device for torch: cpu, cuda, ...")
@reading_options
@study_options()
def command(
    observations: tuple[Path, ...],
    building: str | None,
    exact: bool,
    particles: int,
    chains: int,
    reading: dict[str, Any],
    device: str,
    study: Study,
    seed: int,
    as_json: bool,
) -> None:
    """Draw the posterior of the stiffness factors from the measured files OBSERVATIONS.

    Each file is a CSV table of histories (time_s, base, 2F, ..., RF) or of FRFs (frequency_hz, 2F,
    ..., RF). Several sensors on one floor are named 2F:1, 2F:2. Several files are runs of the same
    building, which one posterior explains together. The options hold for all files.
    """
    from femupdate.workflow.calibrate import calibrate_study
    from femupdate.workflow.calibrate_settings import CalibrationSettings
    from femupdate.workflow.checks import check_calibration
    from femupdate.workflow.model import open_study
    from femupdate.workflow.observed import ObservationSource
    from femupdate.workflow.summary import identifiability_record

    first, *further = observations
    source = ObservationSource(first, further=tuple(further), **reading)
    settings = CalibrationSettings(particles, exact, chains, seed, device)
    with Bars() as bars:
        check_calibration(study, source, settings, building)
        model = open_study(study, building, bars)
        report = calibrate_study(study, model, source, settings, bars)
    posterior = report.posterior
    draws = posterior.samples
    quantiles = {q: _quantile(draws, q) for q in (0.05, 0.95)}
    if as_json:
        content = {
            "posterior": report.path,
            "likelihood": posterior.likelihood,
            "parameters": posterior.names,
            "mean": draws.mean(axis=0),
            "sd": draws.std(axis=0),
            "q05": quantiles[0.05],
            "q95": quantiles[0.95],
            "r_hat": report.r_hat,
            "misfit": report.misfit,
            "posterior_predictive_p": None if report.check is None else report.check.as_dict(),
            "identifiability": identifiability_record(report.identified),
            "particles": len(draws),
            "evaluations": report.evaluations,
            "invalid": report.invalid,
            "files": source.paths,
            "floors": posterior.observation.floors,
            "notes": report.notes,
            "pictures": report.pictures,
            "seconds": report.seconds,
        }
        zeta = posterior.zeta_samples
        if zeta is not None:
            content["zeta"] = {"mean": zeta.mean(), "sd": zeta.std()}
        if posterior.log_evidence is not None:
            content["log_evidence"] = posterior.log_evidence.mean()
            content["log_evidence_sd"] = posterior.log_evidence.std()
        print_json(content)
        return
    click.echo(
        f"{posterior.likelihood.capitalize()} posterior of {model.building.name} from "
        f"{', '.join(posterior.observation.floors)} of {posterior.observation.source}: "
        f"{len(draws)} draws, {report.seconds:.1f} s"
    )
    rows = [
        (name, *(f"{v:.4f}" for v in (mean, sd, low, high)), f"{hat:.3f}")
        for name, mean, sd, low, high, hat in zip(
            posterior.names,
            draws.mean(axis=0),
            draws.std(axis=0),
            quantiles[0.05],
            quantiles[0.95],
            report.r_hat,
            strict=True,
        )
    ]
    click.echo(table(("", "mean", "sd", "5 %", "95 %", "r-hat"), rows))
    if posterior.zeta_samples is not None:
        zeta = posterior.zeta_samples
        click.echo(f"  damping ratio {zeta.mean():.4f} +- {zeta.std():.4f}")
    if posterior.log_evidence is not None:
        evidence = posterior.log_evidence
        click.echo(f"  log evidence {evidence.mean():.2f} +- {evidence.std():.2f} (runs)")
    if report.check is not None:
        click.echo(f"  {report.check.sentence()}")
    print_notes(report.notes)
    print_pictures((report.path, *report.pictures))


def _quantile(draws, q):  # type: ignore[no-untyped-def]
    import numpy as np

    return np.quantile(draws, q, axis=0)
