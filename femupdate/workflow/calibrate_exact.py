"""Sampling by the data-space likelihood: from the latent posterior, or from maxima."""

import numpy as np
import torch
from torch import Tensor

from femupdate.inference.bridge import as_smc_result
from femupdate.inference.hamiltonian import HamiltonianSettings, hamiltonian_draws
from femupdate.inference.laplace import LaplaceSettings, LaplaceStart, laplace_start
from femupdate.inference.likelihood import DataLikelihood, LatentLikelihood
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import SmcResult, SmcSettings, TemperedSmc
from femupdate.measurement.observation import Observation
from femupdate.study import Study
from femupdate.workflow.calibrate_latent import decoded
from femupdate.workflow.calibrate_notes import TEMPERED, cost_notes
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled
from femupdate.workflow.decoded import FEW
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.train import find_surrogate

# Effective share of draws from the Gaussians at the maxima below which chains take over, tried on
# so many draws.
_GAUSSIAN_ENOUGH, _TRIED = 0.1, 400
# Chains that run side by side: they share batches, and differ where they have not mixed.
_SIDE_BY_SIDE = 16


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
        model.reduced,
        model.law,
        observation,
        fixed,
        device=settings.device,
        precision=torch.float32,
    )
    found, base = find_surrogate(study, model), None
    if prior.size > FEW:
        near = None
        if found is not None:
            near = decoded(found[0], model, observation, settings, run).draws.theta[:, -1]
        return Sampled(*_sample_from_maxima(model, observation, settings, run, prior, target, near))
    if found is None:
        starts = run(
            TemperedSmc(prior, target, settings=settings.smc), "Sampling (data-space likelihood)"
        )
    else:
        size = model.prior.size
        latent = LatentLikelihood(
            found[0], model.reduced, model.law, observation, device=settings.device
        )

        def base(parameters: Tensor) -> Tensor:
            return latent(parameters[:, :size])

        starts = run(
            TemperedSmc(prior, base, settings=settings.smc), "Sampling (latent likelihood)"
        )
    results = run.bridge(prior, target, base, starts, settings.smc)
    return Sampled(
        [as_smc_result(result, start) for result, start in zip(results, starts, strict=True)],
        cost_notes(results, starts, base is not None),
    )


def _sample_from_maxima(
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
    prior: UniformPrior,
    target: DataLikelihood,
    near: Tensor | None,
) -> tuple[list[SmcResult], tuple[str, ...]]:
    """Many parameters: from Gaussians at the maxima of the posterior density, by chains where
    those are too crude. The maxima are looked for near draws of the latent posterior, if any."""
    fixed = model.building.damping.ratio if prior.size == model.prior.size else None
    exact = DataLikelihood(model.reduced, model.law, observation, fixed, device=settings.device)
    chosen = LaplaceSettings()
    run.show.start("Searching for maxima", chosen.evaluations(prior.size))
    start = laplace_start(prior, exact.residuals, settings.seed, chosen, run.show.advance, near)
    count = len(start.reached)
    found = (
        f"{sum(start.reached)} of {chosen.starts} searches ended in the one maximum that counts"
        if count == 1
        else f"searches from {chosen.starts} starts ended in {count} maxima that count"
    )
    if start.effective_share(target, _TRIED, settings.seed) < _GAUSSIAN_ENOUGH:
        results, how = _hamiltonian(run, prior, target, start)
    else:
        results, how = _around_maxima(run, prior, target, start, settings.smc)
    if near is not None:
        found += " (all from draws of the latent posterior)"
    return results, (
        f"The posterior was found by its maxima: {found}, after "
        f"{start.evaluations + _TRIED:,} responses; {how} A maximum that no search led to is "
        "missing.",
    )


def _around_maxima(
    run: ChainRunner,
    prior: UniformPrior,
    target: DataLikelihood,
    start: LaplaceStart,
    settings: SmcSettings,
) -> tuple[list[SmcResult], str]:
    """Importance sampling from the Gaussians, and what it took."""
    starts = []
    for chain in range(run.chains):
        theta = start.draw(run.each, run.seed_of(chain))
        starts.append(SmcResult(theta, start.log_likelihood(theta), 0.0, (), 0, 0))
    results = run.bridge(prior, target, start.log_likelihood, starts, settings)
    how = f"sampling took {sum(result.evaluations for result in results):,} more."
    if min(result.effective_share for result in results) <= 0.0:
        how = f"{how} {TEMPERED}"
    return [as_smc_result(result, one) for result, one in zip(results, starts, strict=True)], how


def _hamiltonian(
    run: ChainRunner, prior: UniformPrior, target: DataLikelihood, start: LaplaceStart
) -> tuple[list[SmcResult], str]:
    """Chains from the maxima where the posterior is far from Gaussian, and what they took."""
    settings = HamiltonianSettings()
    draws = max(-(-run.particles // _SIDE_BY_SIDE), 2)
    run.show.start("Sampling (Hamiltonian Monte Carlo)", settings.warm_up + draws)
    result = hamiltonian_draws(
        prior, target, start, _SIDE_BY_SIDE, draws, run.seed, settings, run.show.advance
    )
    each = result.gradients // _SIDE_BY_SIDE
    parts = zip(result.theta, result.log_likelihood, strict=True)
    how = (
        f"the posterior bends too much for Gaussians, so {_SIDE_BY_SIDE} chains of Hamiltonian "
        f"Monte Carlo drew it, with {result.gradients:,} gradients ({result.acceptance:.0%} of "
        "their moves accepted); they give no evidence"
    )
    if len(start.reached) > 1:
        how += ", and the shares of separate maxima are those of their Gaussians"
    return [SmcResult(theta, value, np.nan, (), each, 0) for theta, value in parts], f"{how}."
