"""Sampling by the data-space likelihood: about its maxima, or from the prior."""

from dataclasses import replace

import numpy as np
import torch

from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.progress import Progress
from femupdate.seeds import Seed, spawn
from femupdate.study import Study
from femupdate.surrogate.storage import find_surrogate
from femupdate.workflow.calibrate_effects import FittedEffects
from femupdate.workflow.calibrate_notes import (
    elsewhere_warnings,
    noise_notes,
    reduction_warnings,
)
from femupdate.workflow.calibrate_settings import FEW, CalibrationSettings, Sampled
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import (
    on_fewer_modes,
    settled_likelihood,
    smooth_likelihood,
)
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import (
    FROM_FIT,
    FROM_LATENT,
    FROM_PRIOR,
    Target,
    sampled_about_maxima,
    sampled_by_particles,
    sampled_by_trajectories,
)


def sample_exact(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    seed: Seed,
    show: Progress,
    fitted: FittedEffects | None = None,
) -> Sampled:
    """Draw the data-space posterior by the way that suits it, which the result tells.

    Importance draws about the maxima come first; particles from the prior where these are not
    enough. Many parameters take Hamiltonian moves.
    """
    first, second = spawn(seed, 2)
    target = _target(study, model, measured, settings, first, fitted)
    many = model.parameters.size > FEW
    sampled = None
    if target.maxima is not None and (fitted is not None or not many):
        sampled = sampled_about_maxima(target, settings.particles, second, show)
    if sampled is None:
        sample = sampled_by_trajectories if many else sampled_by_particles
        sampled = sample(target, settings, seed, show)
    if fitted is not None or measured.beyond_surrogates:
        return sampled
    notes = (*noise_notes(model, measured.base, model.least_noise), *sampled.notes)
    warnings = reduction_warnings(model, measured.base)
    if many:
        missed = _missed_by_best(sampled)
        warnings += elsewhere_warnings(model, measured.base, model.least_noise, missed)
    return replace(
        sampled,
        notes=notes,
        warnings=(*sampled.warnings, *warnings),
        least_noise=model.least_noise,
    )


def _target(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    seed: Seed,
    fitted: FittedEffects | None,
) -> Target:
    """The likelihood and its maxima.

    They are sought from the fit of listed effects, from the solutions of the latent posterior where
    there is a surrogate, which saves most of the responses, or from likely points of the prior.
    """
    if not measured.has_base and model.parameters.size > FEW and fitted is None:
        # Nothing is to be learned about the maxima.
        return Target(smooth_likelihood(model, measured), None, FROM_PRIOR)
    surrogate, starts, origin = None, None, FROM_PRIOR
    if fitted is not None:
        # A frame's model serves about its fit alone, so there no particles of the prior can help.
        model, origin = fitted.model, FROM_FIT
        starts = fitted.starts(smooth_likelihood(model, measured, settings.device), settings.seed)
    elif not measured.beyond_surrogates:
        surrogate = find_surrogate(study, model.building)
    if surrogate is not None:
        latent = LatentLikelihood(surrogate[0], model.system, measured.base, device=settings.device)
        starts, origin = latent.solutions(), FROM_LATENT
    found = settled_likelihood(
        model, measured, settings, starts, settings.seed if measured.has_base else seed
    )
    local = fitted is not None and fitted.local
    return Target(
        on_fewer_modes(found.likelihood), found.found, origin, local=local, tried=found.tried
    )


def _missed_by_best(sampled: Sampled) -> float:
    """Root mean square by which the likeliest draw misses the measured ln|H|."""
    likelihood = sampled.likelihood
    base = likelihood.base
    assert base is not None
    density = np.concatenate([run.log_likelihood.cpu().numpy() for run in sampled.runs])
    best = torch.cat([run.theta for run in sampled.runs])[int(density.argmax())]
    values = likelihood.prior.split(best[None])
    answer = base.predicted(likelihood.system, values.theta, values.zeta, values.sizes)[0]
    return float((base.log_frf - answer.cpu())[base.valid].square().mean().sqrt())
