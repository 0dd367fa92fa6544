"""Sampling by the latent likelihood: particles, or chains on the decoder."""

import numpy as np

from femupdate.inference.decoded_chains import DecodedPosterior, DecodedSettings
from femupdate.inference.likelihood import LatentLikelihood, usual_misfit
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
)
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled
from femupdate.workflow.decoded import FEW, sample_decoded
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.train import require_surrogate


def sample_latent(
    study: Study,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Latent likelihood; by chains on the decoder where there are many parameters."""
    surrogate = require_surrogate(study, model)
    least = surrogate.info.noise_sd
    noise, calibration = (
        told(surrogate.info, observation) for told in (noise_notes, calibration_notes)
    )
    # The chains on the decoder know no effects.
    if model.prior.size > FEW and model.system is None:
        results, notes = _sample_decoded(surrogate, model, observation, settings, run)
        return Sampled(results, (*noise, *notes, *calibration), None, least)
    likelihood = LatentLikelihood(
        surrogate,
        model.responder,
        model.law,
        observation,
        device=settings.device,
        shared=model.shared,
    )
    sampler = TemperedSmc(model.prior.to(settings.device), likelihood, settings=settings.smc)
    results = run(sampler, "Sampling (latent likelihood)")
    notes = (*likelihood.input.notes, *noise, *latent_notes(likelihood), *calibration)
    return Sampled(results, notes, likelihood.found, least)


def _sample_decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> tuple[list[SmcResult], tuple[str, ...]]:
    """Many parameters: chains on the decoder, with zeta as one more where it is a nuisance."""
    found = decoded(surrogate, model, observation, settings, run)
    each = found.draws.gradients // len(found.draws.theta)
    results = [
        SmcResult(theta, value, np.nan, (), each, 0)
        for theta, value in zip(found.draws.theta, found.draws.log_likelihood, strict=True)
    ]
    usual = usual_misfit(observation)
    noise = max(float(np.median(observation.noise_sd[observation.valid])), surrogate.info.noise_sd)
    return results, (*decoded_notes(found, noise), *misfit_notes(found.misfit, usual))


def decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> DecodedPosterior:
    """The decoder's posterior by chains, with zeta as one more parameter where it is unknown."""
    chosen = DecodedSettings()
    draws = max(-(-run.particles // chosen.chains), 2)
    run.show.start("Sampling (latent likelihood)", chosen.trajectories(draws))
    return sample_decoded(
        surrogate,
        model,
        observation,
        draws,
        settings.seed,
        chosen,
        device=settings.device,
        progress=run.show.advance,
    )
