"""calibrate --exact for a building whose file lists effects, and what its posterior predicts."""

import time
from dataclasses import replace

import numpy as np

from femupdate.discrepancy.data import Data
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.posterior import draw
from femupdate.discrepancy.records import SecondRecord, base_data
from femupdate.discrepancy.search import prepared, refined
from femupdate.effects.listed import building_effects
from femupdate.inference.posterior import save_posterior
from femupdate.progress import SILENT, Progress
from femupdate.study import Study
from femupdate.workflow.amplitude import changes_with_level, level_settings
from femupdate.workflow.calibrate_notes import error_notes
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.calibration_report import POSTERIOR, CalibrationReport
from femupdate.workflow.diagnose import finder_model
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.finder_data import Given
from femupdate.workflow.kinds import Measured
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.repaired import check_of, effect_posterior, misfit_of
from femupdate.workflow.second_record import level_between
from femupdate.workflow.summary import identified


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
    posterior = effect_posterior(model, observation, fitted, draws, kept)
    path = study.result("posterior.nc")
    save_posterior(posterior, path)
    origin = {**model.made_from(), **source.made_from()}
    study.record(POSTERIOR, "posterior.nc", "calibrate", origin, source.files_as_settings())
    found = identified(posterior)
    # The decisive come first.
    notes = (
        *posterior.warnings,
        *error_notes(posterior),
        *found.sentences(),
        *measured.notes,
        f"{draws.effective:.0f} of {settings.particles} proposals count (importance sampling about "
        "the best fit).",
    )
    report = CalibrationReport(
        model=model,
        posterior=posterior,
        path=path,
        r_hat=None,
        identified=found,
        misfit=misfit_of(fitted),
        check=check_of(fitted, draws),
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
    """All that was measured, as the finder judges it; phases where |H| does not show an effect."""
    phase = any(one.effect.needs_phase for one in building_effects(model.building).placed)
    nothing = replace(measured.base, valid=np.zeros_like(measured.base.valid))
    others = replace(measured, base=nothing)
    parts = Given(others).data(model, mesh, use_phase=phase)
    if not measured.has_base:
        return parts
    first, *further = _records(model, source, measured)
    base = base_data(model.building, mesh, first.observation, phase, (), further)
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
