"""Sampling by the latent likelihood."""

from functools import partial

from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.smc import TemperedSmc
from femupdate.progress import Progress
from femupdate.seeds import Seed, spawn
from femupdate.study import Study
from femupdate.surrogate.storage import require_surrogate
from femupdate.workflow.calibrate_notes import calibration_notes, latent_notes, misfit_warnings
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled, drawn_by
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import settled_likelihood
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import sampled_chains


def sample_latent(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    seed: Seed,
    show: Progress,
) -> Sampled:
    """Draw the latent posterior by particles."""
    observation, surrogate = measured.base, require_surrogate(study, model.building)
    likelihood = LatentLikelihood(
        surrogate,
        model.system,
        observation,
        device=settings.device,
        learning=partial(settled_likelihood, model, measured, settings),
    )
    assert likelihood.settled is not None
    sampler = TemperedSmc(model.prior.to(settings.device), likelihood, settings.smc)
    label, first = "Sampling (latent likelihood)", spawn(seed, 1)[0]
    runs = sampled_chains(sampler, label, settings, first, show)
    return Sampled(
        runs,
        model.prior,
        drawn_by("latent", "tempered particles", runs, evidence=False),
        (
            *likelihood.input.notes,
            *latent_notes(likelihood),
            *calibration_notes(surrogate.info, observation),
        ),
        likelihood.settled.likelihood,
        latent=likelihood.found,
        warnings=misfit_warnings(likelihood.found.misfit, likelihood.usual_misfit),
    )
