"""calibrate: from an observation file to the posterior of the stiffness factors."""

import time
from dataclasses import replace

from femupdate.effects.registry import building_effects
from femupdate.errors import StudyError
from femupdate.inference.latent_likelihood import encoder_input
from femupdate.progress import SILENT, Progress
from femupdate.seeds import spawn
from femupdate.study import Study
from femupdate.surrogate.storage import find_surrogate
from femupdate.workflow.amplitude import base_peak, far_stronger, level_settings
from femupdate.workflow.calibration_report import CalibrationReport, kept_posterior
from femupdate.workflow.conclusion import concluded
from femupdate.workflow.effects import with_finer_mesh
from femupdate.workflow.kinds import measured_of, read_measured_of
from femupdate.workflow.likelihoods import (
    CalibrationSettings,
    plain_settings,
    unserved,
    without_foreign_modes,
)
from femupdate.workflow.model import StudyModel, choose_building
from femupdate.workflow.observed import ObservationSource, check_readable
from femupdate.workflow.sampling import fitted_effects, sample_exact, sample_latent


def calibrate_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    settings: CalibrationSettings | None = None,
    progress: Progress = SILENT,
) -> CalibrationReport:
    """Draw the posterior for an observation file; store it.

    Raises:
        MeasurementError: the observation cannot be used.
        InferenceError: the sampler cannot go on.
    """
    started = time.monotonic()
    settings = settings or CalibrationSettings()
    model = with_finer_mesh(study, model, progress)
    source = source.opened()
    measured = read_measured_of(study, model, source, progress)
    measured = without_foreign_modes(model, measured)
    # Surrogates know FRFs under a base that translates.
    why, exact = "", settings.exact or measured.beyond_surrogates
    if not exact and (why := unserved(model.building)):
        why = f"{model.building.name} {why}: the likelihood of the data themselves was sampled."
    elif not exact and find_surrogate(study, model.building) is None:
        progress.say("No surrogate is trained: sampling the likelihood of the data")
        why = (
            f"No surrogate of {model.building.name} is trained, so the likelihood of the data "
            "themselves was sampled; many calibrations are quicker after `femupdate train`."
        )
    settings = replace(settings, exact=exact or bool(why))
    fitted = None
    if building_effects(model.building).placed:
        fitted = fitted_effects(study, model, measured, progress)
        model = fitted.model
    sampling, *drawing = spawn(settings.seed, 5)
    used = {"sensors": list(measured.as_observation.floors), "band_hz": source.band_hz}
    settled = {**used, **plain_settings(settings)}
    if settings.exact:
        sampled = sample_exact(study, model, measured, settings, sampling, progress, fitted)
    else:
        sampled = sample_latent(study, model, measured, settings, sampling, progress)
    try:
        before = kept_posterior(study, model.building).settings
    except StudyError:
        before = {}
    noted = (*far_stronger(before, base_peak(model, source)), *[why] * bool(why))
    sampled = replace(sampled, notes=(*noted, *sampled.notes))
    progress.start("Comparing the posterior with the data", 1)
    report = concluded(
        model, measured, settings, sampled, drawing, study.result("posterior.nc")
    ).with_settings(level_settings(model, model.system.placed, source, measured.levels))
    report.keep(study, "calibrate", source, {**source.files_as_settings(), **settled})
    return replace(report, seconds=time.monotonic() - started, files=source.paths)


def check_calibration(
    study: Study,
    source: ObservationSource,
    settings: CalibrationSettings,
    building: str | None = None,
) -> None:
    """Read and compare all that a calibration needs, and write nothing.

    Args:
        building: name or path, for a new study.

    Raises:
        MeasurementError: the observation cannot be used, or belongs to another building.
        BuildingError: the building cannot be read.
        StudyError: the study is of another building, or cannot be written.
    """
    study.check_writable()
    check_readable(source)
    chosen = choose_building(study, building)
    measured = measured_of(chosen, source)
    needless = settings.exact or measured.beyond_surrogates or unserved(chosen)
    if not needless and (found := find_surrogate(study, chosen)) is not None:
        encoder_input(measured.base, found[0].info.floors)
