"""calibrate --exact for a building whose file lists effects, and what its posterior predicts."""

import time
from collections.abc import Sequence

import torch

from femupdate.discrepancy.fit import Fit, raw_residuals
from femupdate.discrepancy.frf_data import FrfData
from femupdate.discrepancy.posterior import Draws, draw
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.records import SecondRecord, base_data
from femupdate.discrepancy.search import prepared, refined
from femupdate.effects.listed import building_effects
from femupdate.inference.posterior import save_posterior
from femupdate.inference.predictive_check import PredictiveCheck, predictive_check
from femupdate.measurement.observation import Observation
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.workflow.amplitude import changes_with_level, level_settings
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.calibration_report import POSTERIOR, CalibrationReport
from femupdate.workflow.diagnose import finder_model
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource, as_one, runs_of
from femupdate.workflow.repaired import effect_posterior
from femupdate.workflow.second_record import level_between
from femupdate.workflow.summary import identified, write_summary
from femupdate.workflow.thresholds import CALIBRATION


def calibrate_with_effects(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    settings: CalibrationSettings,
    progress: Progress | None = None,
) -> CalibrationReport:
    """Draw the posterior of stiffness factors and effects of a building that lists effects.

    Raises:
        MeasurementError: the observation cannot be used.
        BuildingError: an effect cannot be.
    """
    show, started = progress or Silent(), time.monotonic()
    runs = runs_of(model.building, source)
    observation = as_one(model.building, runs)
    first, *others = _records(model, source, runs)
    finder = finder_model(study, model, show)
    data = base_data(model.building, finder.mesh, first.observation, False, (), others)
    problem, fitted = prepared(finder, (data,), None, show)
    problem, fitted = refined(finder, problem, fitted, show, alone=True)
    if problem.reduced.structure.operators is not None:
        keep_basis(study, problem.reduced, model.building)
    show.start("Drawing the posterior", 1)
    draws = draw(problem, fitted, settings.particles, settings.seed)
    show.advance()
    kept = level_settings(model, fitted.placed, source)
    posterior = effect_posterior(model, observation, draws, kept)
    path = study.result("posterior.nc")
    save_posterior(posterior, path)
    origin = {**model.made_from(), **source.made_from()}
    study.record(POSTERIOR, "posterior.nc", "calibrate", origin, source.files_as_settings())
    misfit = fitted.chi2 / max(problem.effective, 1.0)
    found = identified(posterior)
    notes = (
        *observation.notes,
        *_notes(problem, fitted, draws.effective, settings.particles),
        *found.sentences(),
    )
    check = _check(data, fitted, draws)
    write_summary(study, posterior, found, misfit, notes, check)
    return CalibrationReport(
        model=model,
        posterior=posterior,
        path=path,
        r_hat=None,
        identified=found,
        misfit=misfit,
        check=check,
        notes=notes,
        seconds=time.monotonic() - started,
        invalid=0,
        files=source.paths,
    )


def _records(
    model: StudyModel, source: ObservationSource, runs: Sequence[Observation]
) -> list[SecondRecord]:
    """Every run, with its level above the first where an effect of the building depends on it."""
    changes = changes_with_level(building_effects(model.building).placed)
    first, *_ = source.runs
    return [
        SecondRecord(run, level_between(model, first, one) if changes and one != first else 0.0)
        for run, one in zip(runs, source.runs, strict=True)
    ]


def _check(data: FrfData, fitted: Fit, draws: Draws) -> PredictiveCheck:
    """Posterior predictive check with the noise as stated; errors that points share are part of it,
    as they are of the likelihood."""
    some = slice(None, None, max(1, len(draws.theta) // CALIBRATION.checked))
    parts = (torch.from_numpy(values[some]) for values in (draws.theta, draws.zeta, draws.sizes))
    (error,), (row,) = fitted.problem.error.parts, fitted.problem.row
    residual = error.tame(raw_residuals(fitted, fitted.coordinates.joined(*parts)), row)
    squares = error.floor_squares(residual, torch.full((len(residual),), row))
    freedom = (data.valid * data.independent).sum(1)
    return predictive_check(squares.numpy(), freedom.numpy(), data.names)


def _notes(problem: Problem, fitted: Fit, effective: float, count: int) -> tuple[str, ...]:
    notes = [
        f"{effective:.0f} of {count} proposals count (importance sampling about the best fit)."
    ]
    misfit = fitted.chi2 / max(problem.effective, 1.0)
    if misfit > 2.0:
        notes.append(
            f"The model misses the data by {misfit**0.5:.1f} times their noise, which is taken as "
            "that much larger; `femupdate diagnose` looks for what is missing."
        )
    if effective < 100:
        notes.append("Few proposals count: the posterior is not of one piece; trust it little.")
    return tuple(notes)


__all__ = ["calibrate_with_effects"]
