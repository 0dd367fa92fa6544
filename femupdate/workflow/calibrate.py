"""calibrate: from an observation file to the posterior of the stiffness factors."""

import json
import time
from collections.abc import Sequence
from dataclasses import replace

from femupdate import __version__
from femupdate.inference.diagnostics import r_hat
from femupdate.inference.posterior import save_posterior
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, spawn
from femupdate.study import Study
from femupdate.workflow.calibrate_draws import (
    against_data,
    against_modes,
    posterior_of,
    with_error_of_all,
)
from femupdate.workflow.calibrate_exact import sample_exact
from femupdate.workflow.calibrate_latent import sample_latent
from femupdate.workflow.calibrate_notes import error_notes, judgement, overstated_noise
from femupdate.workflow.calibrate_settings import CalibrationSettings, plain_settings
from femupdate.workflow.calibration_report import POSTERIOR, CalibrationReport
from femupdate.workflow.finer_mesh import FINER
from femupdate.workflow.kinds import Measured, read_measured_of
from femupdate.workflow.mesh_error import with_finer_mesh
from femupdate.workflow.model import REDUCED, StudyModel
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.run_scatter import scatter_of_runs
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.summary import identified
from femupdate.workflow.surrogates import SURROGATE, require_surrogate


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
    measured = read_measured_of(study, model, source, progress, settings.exact)
    if model.building.effects and (settings.exact or measured.others):
        from femupdate.workflow.calibrate_effects import calibrate_with_effects

        return calibrate_with_effects(study, model, (source, measured), settings, progress)
    if model.building.effects:
        from femupdate.workflow.effect_surrogate import with_effects

        require_surrogate(study, model.building)
        model = with_effects(study, model, progress)
    # Surrogates know FRFs under a base that translates.
    settings = replace(settings, exact=settings.exact or measured.beyond_surrogates)
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
    report = _drawn(study, model, measured, settings, run, drawing)
    save_posterior(report.posterior, report.path)
    made = {**source.files_as_settings(), **settled}
    study.record(POSTERIOR, "posterior.nc", "calibrate", origin, made)
    run.clear()
    report.write_summary(study)
    return replace(report, seconds=time.monotonic() - started, files=source.paths)


def _drawn(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    run: ChainRunner,
    seeds: Sequence[Seed],
) -> CalibrationReport:
    """The posterior, beside the data, and what is to be said of it; nothing is written yet."""
    damping, checking, between, alike = seeds
    observation = measured.as_observation
    sampled = (
        sample_exact(study, model, measured, settings, run)
        if settings.exact
        else sample_latent(study, model, observation, settings, run)
    )
    latent = None if model.shared is None else sampled.latent
    posterior = posterior_of(model, observation, settings, sampled, latent, damping)
    fitting = against_data(model, measured, posterior, sampled, checking)
    warnings = (*sampled.warnings, *judgement(posterior, fitting))
    scatter = scatter_of_runs(model, measured.runs, posterior, between)
    posterior = replace(posterior, warnings=warnings, scatter=scatter)
    posterior = with_error_of_all(posterior, model, alike)
    found = identified(posterior)
    # The decisive come first.
    notes = (
        *warnings,
        *error_notes(posterior),
        *overstated_noise(fitting),
        *(() if scatter is None else (scatter.sentence(),)),
        *found.sentences(),
        *against_modes(model, measured, posterior, checking),
        *measured.notes,
        *sampled.notes,
    )
    return CalibrationReport(
        model=model,
        posterior=posterior,
        path=study.result("posterior.nc"),
        r_hat=r_hat(posterior.theta),
        identified=found,
        misfit=fitting.misfit,
        check=fitting.check,
        notes=notes,
        seconds=0.0,
        invalid=sum(result.invalid for result in sampled.results),
        files=(),
    )


def _judged(study: Study, measured: Measured) -> list[str]:
    """Hashes of what a likelihood is made of: the data as read, reduced model and surrogate."""
    kept = study.artefacts()
    models = [kept[name].sha256 for name in (REDUCED, FINER, SURROGATE) if name in kept]
    return [__version__, measured.fingerprint(), *models]
