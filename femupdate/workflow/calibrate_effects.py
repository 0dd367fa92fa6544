"""calibrate --exact for a building whose file lists effects, and what its posterior predicts."""

import time
from dataclasses import replace

import numpy as np
import torch

from femupdate.discrepancy.data import Data
from femupdate.discrepancy.fit import Fit, raw_residuals
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.posterior import Draws, draw
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.records import SecondRecord, base_data
from femupdate.discrepancy.search import prepared, refined
from femupdate.effects.listed import building_effects
from femupdate.inference.posterior import save_posterior
from femupdate.inference.predictive_check import PredictiveCheck, predictive_check
from femupdate.progress import SILENT, Progress
from femupdate.study import Study
from femupdate.workflow.amplitude import changes_with_level, level_settings
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.calibration_report import POSTERIOR, CalibrationReport
from femupdate.workflow.diagnose import finder_model
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.finder_data import Given
from femupdate.workflow.kinds import Measured
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.repaired import effect_posterior
from femupdate.workflow.second_record import level_between
from femupdate.workflow.summary import identified
from femupdate.workflow.thresholds import CALIBRATION


def calibrate_with_effects(
    study: Study,
    model: StudyModel,
    given: tuple[ObservationSource, Measured],
    settings: CalibrationSettings,
    progress: Progress = SILENT,
) -> CalibrationReport:
    """Draw the posterior of stiffness factors and effects of a building that lists effects.

    Args:
        given: the files, and what they hold.

    Raises:
        MeasurementError: the observation cannot be used.
        BuildingError: an effect cannot be.
    """
    started = time.monotonic()
    source, measured = given
    observation = measured.as_observation
    finder = finder_model(study, model, progress)
    data = _data(model, source, measured, finder.mesh)
    problem, fitted = prepared(finder, data, None, progress)
    problem, fitted = refined(finder, problem, fitted, progress, alone=True)
    if problem.reduced.structure.operators is not None:
        keep_basis(study, problem.reduced, model.building)
    progress.start("Drawing the posterior", 1)
    draws = draw(problem, fitted, settings.particles, settings.seed)
    progress.advance()
    kept = level_settings(model, fitted.placed, source)
    posterior = effect_posterior(model, observation, draws, kept)
    path = study.result("posterior.nc")
    save_posterior(posterior, path)
    origin = {**model.made_from(), **source.made_from()}
    study.record(POSTERIOR, "posterior.nc", "calibrate", origin, source.files_as_settings())
    misfit = fitted.chi2 / max(problem.effective, 1.0)
    found = identified(posterior)
    notes = (
        *measured.notes,
        *_notes(problem, fitted, draws.effective, settings.particles),
        *found.sentences(),
    )
    report = CalibrationReport(
        model=model,
        posterior=posterior,
        path=path,
        r_hat=None,
        identified=found,
        misfit=misfit,
        check=_check(fitted, draws),
        notes=notes,
        seconds=time.monotonic() - started,
        invalid=0,
        files=source.paths,
    )
    report.write_summary(study)
    return report


def _data(
    model: StudyModel, source: ObservationSource, measured: Measured, mesh: MeshError | None
) -> tuple[Data, ...]:
    """All that was measured, as the finder judges it, by amplitudes."""
    nothing = replace(measured.base, valid=np.zeros_like(measured.base.valid))
    others = replace(measured, base=nothing)
    parts = Given(others).data(model, mesh, use_phase=False)
    if not measured.has_base:
        return parts
    first, *further = _records(model, source, measured)
    base = base_data(model.building, mesh, first.observation, False, (), further)
    return (base, *parts)


def _records(
    model: StudyModel, source: ObservationSource, measured: Measured
) -> list[SecondRecord]:
    """Every run, with its level above the first where an effect of the building depends on it."""
    changes = changes_with_level(building_effects(model.building).placed)
    first, *further = measured.base_paths
    sources = replace(source, path=first, further=tuple(further)).runs
    return [
        SecondRecord(
            run, level_between(model, sources[0], one) if changes and one != sources[0] else 0.0
        )
        for run, one in zip(measured.runs, sources, strict=True)
    ]


def _check(fitted: Fit, draws: Draws) -> PredictiveCheck:
    """Posterior predictive check with the noise as stated; errors that points share are part of it,
    as they are of the likelihood."""
    some = slice(None, None, max(1, len(draws.theta) // CALIBRATION.checked))
    known = (torch.from_numpy(values[some]) for values in (draws.theta, draws.zeta, draws.sizes))
    raw = raw_residuals(fitted, fitted.coordinates.joined(*known))
    problem = fitted.problem
    parts = zip(
        problem.data, problem.error.parts, problem.error.apart(raw), problem.row, strict=True
    )
    found: list[tuple[str, torch.Tensor, float]] = []
    for data, error, own, row in parts:
        rows = torch.full((len(own),), row)
        found += data.checked(error.floor_squares(error.tame(own, row), rows))
    names, left, counts = zip(*found, strict=True)
    return predictive_check(torch.stack(left, dim=1).numpy(), counts, names)


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
