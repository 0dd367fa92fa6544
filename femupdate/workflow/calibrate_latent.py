"""Sampling by the latent likelihood: particles, or populations on the decoder."""

from functools import partial

import numpy as np

from femupdate.inference.latent_likelihood import LatentLikelihood, Learning, usual_misfit
from femupdate.inference.smc import TemperedSmc
from femupdate.measurement.observation import Observation
from femupdate.study import Study
from femupdate.workflow.calibrate_notes import (
    LEARNS_NO_ERROR,
    calibration_notes,
    decoded_notes,
    decoder_warnings,
    latent_notes,
    misfit_warnings,
    noise_notes,
    require_own_building,
)
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled, by_runs
from femupdate.workflow.decoded import sample_decoded, sampled_groups
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.surrogates import require_surrogate
from femupdate.workflow.thresholds import CALIBRATION


def sample_latent(
    study: Study,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Latent likelihood; by a population on the decoder where there are many parameters."""
    surrogate = require_surrogate(study, model.building)
    least = surrogate.info.noise_sd
    calibration = calibration_notes(surrogate.info, observation)
    # Draws on the decoder know no effects.
    if model.prior.size > CALIBRATION.few and not model.system.placed:
        found = sample_decoded(surrogate, model, observation, settings, run, run.particles)
        results = sampled_groups(found.draws, found.responses)
        drawn = by_runs("latent", "Hamiltonian moves judged by the reduced model", results)
        told = (
            LEARNS_NO_ERROR,
            *noise_notes(surrogate.info, observation),
            *decoded_notes(found),
            *calibration,
        )
        noise = max(float(np.median(observation.noise_sd[observation.valid])), least)
        warnings = (
            *misfit_warnings(found.misfit, usual_misfit(observation)),
            *decoder_warnings(found.error, noise),
        )
        return Sampled(results, model.parameters, drawn, told, least_noise=least, warnings=warnings)
    likelihood = LatentLikelihood(
        surrogate,
        model.system,
        observation,
        device=settings.device,
        learning=Learning(
            model.parameters,
            model.shared,
            partial(require_own_building, model, anyway=settings.anyway),
        ),
    )
    assert likelihood.settled is not None
    sampler = TemperedSmc(model.prior.to(settings.device), likelihood, settings=settings.smc)
    results = run(sampler, "Sampling (latent likelihood)")
    notes = (*likelihood.input.notes, *latent_notes(likelihood), *calibration)
    drawn = by_runs("latent", "tempered particles", results)
    return Sampled(
        results,
        model.prior,
        drawn,
        notes,
        latent=likelihood.found,
        learned=likelihood.settled.likelihood,
        warnings=misfit_warnings(likelihood.found.misfit, likelihood.usual_misfit),
    )
