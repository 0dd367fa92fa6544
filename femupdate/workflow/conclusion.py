"""What is concluded from posterior draws, however they were drawn, and what is told of it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from femupdate.inference.diagnostics import r_hat
from femupdate.seeds import Seed, spawn
from femupdate.workflow.calibrate_draws import (
    against_data,
    against_modes,
    posterior_of,
    with_error_of_all,
    with_own_errors,
)
from femupdate.workflow.calibrate_notes import error_notes, judgement, overstated_noise
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.kinds import Measured
from femupdate.workflow.model import StudyModel
from femupdate.workflow.run_scatter import scatter_of_runs
from femupdate.workflow.summary import identified


def concluded(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    sampled: Sampled,
    seeds: Sequence[Seed],
    path: Path,
) -> CalibrationReport:
    """The posterior, beside the data, and what is to be said of it; nothing is written yet.

    Args:
        model: with the effects that the building lists.
        seeds: of damping ratios, checks, scatter between runs, and what all members err by.
        path: where the posterior goes.
    """
    damping, checking, between, erring = seeds
    alike, own = erring, spawn(erring, 1)[0]
    latent = None if model.shared is None else sampled.latent
    posterior = posterior_of(model, measured, settings, sampled, latent, damping)
    fitting = against_data(model, measured, posterior, sampled, checking)
    warnings = (*sampled.warnings, *judgement(posterior, fitting))
    scatter = scatter_of_runs(model, measured.runs, posterior, between, measured.levels)
    posterior = replace(posterior, warnings=warnings, scatter=scatter)
    posterior = with_own_errors(with_error_of_all(posterior, model, alike), model, own)
    found = identified(posterior)
    # The decisive come first.
    notes = (
        *warnings,
        *error_notes(posterior),
        *(() if sampled.least_noise else overstated_noise(fitting)),
        *(() if scatter is None else (scatter.sentence(),)),
        *found.sentences(),
        *against_modes(model, measured, posterior, checking),
        *measured.notes,
        *sampled.notes,
    )
    return CalibrationReport(
        model=model,
        posterior=posterior,
        path=path,
        r_hat=r_hat(posterior.theta),
        identified=found,
        misfit=fitting.misfit,
        check=fitting.check,
        notes=notes,
        seconds=0.0,
        invalid=sum(run.invalid for run in sampled.runs),
        files=(),
    )
