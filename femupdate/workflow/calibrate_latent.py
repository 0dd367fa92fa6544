"""Sampling by the latent likelihood: particles, or populations on the decoder."""

from functools import partial

import numpy as np

from femupdate.inference.latent_likelihood import LatentLikelihood, Learning, usual_misfit
from femupdate.inference.smc import SmcResult, TemperedSmc
from femupdate.measurement.observation import Observation
from femupdate.study import Study
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.workflow.calibrate_notes import (
    calibration_notes,
    decoded_notes,
    latent_notes,
    misfit_notes,
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
        results, notes = _sample_decoded(surrogate, model, observation, settings, run)
        drawn = by_runs("latent", "Hamiltonian moves judged by the reduced model", results)
        told = (*noise_notes(surrogate.info, observation), *notes, *calibration)
        return Sampled(results, model.parameters, drawn, told, None, least)
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
        results, model.prior, drawn, notes, likelihood.found, 0.0, likelihood.settled.likelihood
    )


def _sample_decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> tuple[list[SmcResult], tuple[str, ...]]:
    """Many parameters: draws on the decoder, with zeta as one more where it is a nuisance."""
    found = sample_decoded(surrogate, model, observation, settings, run, run.particles)
    usual = usual_misfit(observation)
    noise = max(float(np.median(observation.noise_sd[observation.valid])), surrogate.info.noise_sd)
    notes = (*decoded_notes(found, noise), *misfit_notes(found.misfit, usual))
    return sampled_groups(found.draws, found.responses), notes
