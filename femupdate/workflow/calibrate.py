"""calibrate: from an observation file to the posterior of the stiffness factors."""

import json
import time
from dataclasses import replace

from femupdate import __version__
from femupdate.inference.posterior import save_posterior
from femupdate.progress import SILENT, Progress
from femupdate.seeds import spawn
from femupdate.study import Study
from femupdate.workflow.amplitude import level_settings
from femupdate.workflow.calibrate_effects import fitted_effects, with_levels
from femupdate.workflow.calibrate_exact import sample_exact
from femupdate.workflow.calibrate_latent import sample_latent
from femupdate.workflow.calibrate_settings import CalibrationSettings, plain_settings
from femupdate.workflow.calibration_report import POSTERIOR, CalibrationReport
from femupdate.workflow.conclusion import concluded
from femupdate.workflow.finer_mesh import FINER
from femupdate.workflow.kinds import Measured, read_measured_of
from femupdate.workflow.mesh_error import with_finer_mesh
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.reduced_file import REDUCED
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.surrogates import SURROGATE, unserved


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
        SurrogateError: no surrogate fits the building (latent likelihood).
        InferenceError: the sampler cannot go on.
    """
    started = time.monotonic()
    settings = settings or CalibrationSettings()
    model = with_finer_mesh(study, model, progress)
    source = source.opened()
    measured = read_measured_of(study, model, source, progress)
    # Surrogates know FRFs under a base that translates.
    why = "" if settings.exact else unserved(model.building)
    settings = replace(settings, exact=settings.exact or measured.beyond_surrogates or bool(why))
    fitted = None
    if model.building.effects:
        measured = with_levels(model, source, measured)
        fitted = fitted_effects(study, model, measured, progress)
        model = fitted.model
    sampling, *drawing = spawn(settings.seed, 5)
    origin = {**model.made_from(), **source.made_from()}
    used = {"sensors": list(measured.as_observation.floors), "band_hz": source.band_hz}
    settled = {**used, **plain_settings(settings)}
    run = ChainRunner(
        settings.particles,
        settings.chains,
        sampling,
        progress,
        study.result("sampling"),
        json.dumps([origin, settled, _judged(study, measured)], sort_keys=True),
    )
    sampled = (
        sample_exact(study, model, measured, settings, run, fitted)
        if settings.exact
        else sample_latent(study, model, measured, settings, run)
    )
    if why:
        note = f"{model.building.name} {why}: the likelihood of the data themselves was sampled."
        sampled = replace(sampled, notes=(note, *sampled.notes))
    report = concluded(
        model, measured, settings, sampled, drawing, study.result("posterior.nc")
    ).with_settings(level_settings(model, model.system.placed, source, measured.levels))
    save_posterior(report.posterior, report.path)
    made = {**source.files_as_settings(), **settled}
    study.record(POSTERIOR, "posterior.nc", "calibrate", origin, made)
    run.clear()
    report.write_summary(study)
    return replace(report, seconds=time.monotonic() - started, files=source.paths)


def _judged(study: Study, measured: Measured) -> list[str]:
    """Hashes of what a likelihood is made of: the data as read, reduced model and surrogate."""
    kept = study.artefacts()
    models = [kept[name].sha256 for name in (REDUCED.name, FINER, SURROGATE) if name in kept]
    return [__version__, measured.fingerprint(), *models]
