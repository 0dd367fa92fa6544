"""Sampling by the data-space likelihood: from the latent posterior, or from the prior."""

import torch
from torch import Tensor

from femupdate.inference.bridge import as_smc_result
from femupdate.inference.likelihood import DataLikelihood, LatentLikelihood
from femupdate.inference.smc import TemperedSmc
from femupdate.measurement.observation import Observation
from femupdate.study import Study
from femupdate.workflow.calibrate_latent import decoded
from femupdate.workflow.calibrate_notes import cost_notes, reduction_notes
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled
from femupdate.workflow.decoded import FEW, sample_annealed
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.surrogates import find_surrogate


def sample_exact(
    study: Study,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Data-space likelihood, with zeta as one more parameter where it is a nuisance.

    A building with a surrogate starts from the latent posterior, which saves most of the responses.
    """
    bounds = model.zeta_bounds
    prior = model.prior if bounds is None else model.prior.joined("zeta", *bounds)
    fixed = model.building.damping.ratio if bounds is None else None
    target = DataLikelihood(
        model.system,
        observation,
        fixed,
        device=settings.device,
        precision=torch.float32,
    )
    found, base = find_surrogate(study, model.building), None
    if prior.size > FEW:
        drawn = None
        if found is not None:
            drawn = decoded(found[0], model, observation, settings, run, 1)
        groups, notes = sample_annealed(prior, target, run, drawn)
        return Sampled(groups, (*notes, *reduction_notes(model, observation)))
    if found is None:
        starts = run(
            TemperedSmc(prior, target, settings=settings.smc), "Sampling (data-space likelihood)"
        )
    else:
        size = model.prior.size
        latent = LatentLikelihood(found[0], model.system, observation, device=settings.device)

        def base(parameters: Tensor) -> Tensor:
            return latent(parameters[:, :size])

        starts = run(
            TemperedSmc(prior, base, settings=settings.smc), "Sampling (latent likelihood)"
        )
    results = run.bridge(prior, target, base, starts, settings.smc)
    return Sampled(
        [as_smc_result(result, start) for result, start in zip(results, starts, strict=True)],
        (*cost_notes(results, starts, base is not None), *reduction_notes(model, observation)),
    )
