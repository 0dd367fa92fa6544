"""The posterior of a study's building with many stiffness factors, latent and data-space."""

import copy
from dataclasses import replace
from functools import partial

import numpy as np

from femupdate.inference.decoded import Decoded
from femupdate.inference.decoded_chains import (
    DecodedPosterior,
    StageProgress,
    decoded_posterior,
    in_groups,
)
from femupdate.inference.learned import beside_shared
from femupdate.inference.parameters import Parameters
from femupdate.inference.sampler_run import SamplerRun
from femupdate.inference.smc import TRAJECTORIES, KeptDraws, SmcState, TemperedSmc
from femupdate.inference.tempering import LogLikelihood
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.units import percent
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import smooth_likelihood
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import BRIDGE, FIRST, ChainRunner

# Responses of a building do not go faster by the hundred on a processor.
_ROWS = 8


def sample_decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    run: ChainRunner,
    draws: int,
) -> DecodedPosterior:
    """Draw theta, and the damping ratio behind it where it is unknown, along the decoder.

    Args:
        measured: FRFs under base motion; their noise is believed from the surrogate's on.
        draws: states to keep, at least.
    """
    info, chosen = surrogate.info, in_groups(run.chains)
    mvae = copy.deepcopy(surrogate.mvae).to(settings.device).requires_grad_(False)
    exact = smooth_likelihood(model, measured, settings.device, info.noise_sd)
    assert exact.base is not None
    shared = model.shared
    beside = None if shared is None else partial(beside_shared, shared, measured.base)
    run.show.start("Sampling (latent likelihood)", 100 * chosen.stages)
    return decoded_posterior(
        replace(exact, prior=exact.prior.to(settings.device)),
        Decoded(mvae, exact.base),
        draws,
        run.stage(FIRST),
        chosen,
        run.show,
        power=info.likelihood_power,
        beside=beside,
    )


def missed_by_best(found: DecodedPosterior) -> float:
    """Root mean square by which the likeliest draw misses the measured ln|H|."""
    draws, likelihood = found.draws, found.likelihood
    base = likelihood.base
    assert base is not None
    best = draws.theta.flatten(0, 1)[draws.log_likelihood.flatten().argmax()]
    values = likelihood.prior.split(best[None])
    answer = base.predicted(likelihood.system, values.theta, values.zeta, values.sizes)[0]
    return float((base.log_frf - answer.cpu())[base.valid].square().mean().sqrt())


def sample_annealed(
    prior: Parameters, target: LogLikelihood, run: ChainRunner, latent: DecodedPosterior | None
) -> tuple[list[SamplerRun], tuple[str, ...]]:
    """Draw the data-space posterior, from the latent one or from the prior: groups, and how.

    Args:
        prior: of the parameters, with the damping ratio last where it is unknown.
        run: says how many draws in how many groups.
    """
    settings, show, seed = in_groups(run.chains, _ROWS), run.show, run.stage(BRIDGE)
    base = None if latent is None else latent.along
    sampler = TemperedSmc(prior, target, base, settings.population, TRAJECTORIES)
    show.start("Sampling (data-space likelihood)", 200)
    if latent is None:
        begun, spent, origin = sampler.init(settings.particles, seed), 0, "the prior"
    else:
        begun = sampler.taken_over(latent.population, seed)
        spent, origin = latent.population.evaluations, "the latent posterior"
    reached = sampler.reach(begun, StageProgress(show).level)
    found = sampler.draws(reached, run.particles, StageProgress(show).share)
    responses = found.state.evaluations - spent
    return sampled_groups(found, responses, evidence=True), (
        f"{tempered_words(found.state, len(found.theta))} drew the data-space posterior from "
        f"{origin}, with {responses:,} gradients of responses "
        f"({percent(found.acceptance)} of the moves accepted).",
    )


def sampled_groups(
    draws: KeptDraws, evaluations: int, *, evidence: bool = False
) -> list[SamplerRun]:
    """The groups as independent runs; without an evidence where it is of no data."""
    groups, state = len(draws.theta), draws.state
    told = state.log_evidence if evidence else (np.nan,) * groups
    return [
        SamplerRun(
            theta=theta,
            log_likelihood=value,
            log_evidence=known,
            evaluations=evaluations // groups,
            levels=state.levels,
            invalid=state.invalid // groups,
        )
        for theta, value, known in zip(draws.theta, draws.log_likelihood, told, strict=True)
    ]


def tempered_words(population: SmcState, groups: int) -> str:
    """What a population is and how it came about: the subject of a sentence."""
    return (
        f"{len(population.points.xi)} particles in {groups} groups, tempered over "
        f"{len(population.levels)} "
        "powers of the likelihood with Hamiltonian moves,"
    )
