"""Sampling by the latent likelihood: particles, or populations on the decoder."""

from functools import partial

import numpy as np

from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.smc import TemperedSmc
from femupdate.study import Study
from femupdate.workflow.calibrate_notes import (
    calibration_notes,
    decoded_notes,
    decoder_warnings,
    elsewhere_warnings,
    latent_notes,
    misfit_warnings,
    noise_notes,
)
from femupdate.workflow.calibrate_settings import FEW, CalibrationSettings, Sampled, drawn_by
from femupdate.workflow.decoded import missed_by_best, sample_decoded, sampled_groups
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import (
    require_own_building,
    settled_likelihood,
)
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.surrogates import require_surrogate


def sample_latent(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Latent likelihood; by a population on the decoder where there are many parameters."""
    observation, surrogate = measured.base, require_surrogate(study, model.building)
    least = surrogate.info.noise_sd
    calibration = calibration_notes(surrogate.info, observation)
    # Draws on the decoder know no effects.
    if model.prior.size > FEW and not model.system.placed:
        found = sample_decoded(surrogate, model, measured, settings, run, run.particles)
        require_own_building(model, found.likelihood, found.states, anyway=settings.anyway)
        runs = sampled_groups(found.draws, found.responses)
        way = "Hamiltonian moves judged by the reduced model"
        drawn = drawn_by("latent", way, runs, evidence=False)
        told = (*noise_notes(model, observation, least), *decoded_notes(found), *calibration)
        noise = max(float(np.median(observation.noise_sd[observation.valid])), least)
        return Sampled(
            runs,
            model.parameters,
            drawn,
            told,
            found.likelihood,
            least_noise=least,
            warnings=(
                *elsewhere_warnings(model, observation, least, missed_by_best(found)),
                *decoder_warnings(found.error, noise),
            ),
        )
    likelihood = LatentLikelihood(
        surrogate,
        model.system,
        observation,
        device=settings.device,
        learning=partial(settled_likelihood, model, measured, settings),
    )
    assert likelihood.settled is not None
    sampler = TemperedSmc(model.prior.to(settings.device), likelihood, settings=settings.smc)
    runs = run(sampler, "Sampling (latent likelihood)")
    notes = (*likelihood.input.notes, *latent_notes(likelihood), *calibration)
    drawn = drawn_by("latent", "tempered particles", runs, evidence=False)
    return Sampled(
        runs,
        model.prior,
        drawn,
        notes,
        likelihood.settled.likelihood,
        latent=likelihood.found,
        warnings=misfit_warnings(likelihood.found.misfit, likelihood.usual_misfit),
    )
