"""Latent posterior and bridge against the exact posterior of one observation."""

import time
from dataclasses import dataclass

from femupdate.inference.importance import draws_about_particles
from femupdate.inference.smc import TemperedSmc

from .case import Case, Shear4dof, data_likelihood, exact_posterior
from .comparison import Comparison, compare


@dataclass(frozen=True, kw_only=True)
class ObservationResult:
    """Both posteriors of one observation."""

    solutions: int  # how many stiffness vectors share its roof response
    # latent, bridged: against the exact posterior
    latent: Comparison
    bridged: Comparison
    evidence_error: float  # log evidence of the bridge less the exact one
    evidence_sd: float  # the standard error that the bridge gives
    effective_share: float  # of the bridge's importance draws
    latent_evaluations: int  # of the latent likelihood
    latent_responses: int  # of the building that the latent likelihood took
    responses: int  # of the bridge
    # latent_seconds, bridge_seconds: of each
    latent_seconds: float
    bridge_seconds: float


def observation_result(
    problem: Shear4dof, case: Case, seed: int, reference_draws: int, particles: int
) -> ObservationResult:
    """Sample both posteriors of a case and compare them with its exact one."""
    exact = problem.exact
    if case is not problem.case:
        exact = exact_posterior(problem.model, case, reference_draws, seed)
    prior, latent = problem.model.prior, problem.latent(case)
    started = time.monotonic()
    start = TemperedSmc(prior, latent).run(particles, seed)
    middle = time.monotonic()
    target = data_likelihood(problem.model, case)
    weighted = draws_about_particles(prior, target, start.theta, 4 * particles, seed)
    found = weighted.resampled(particles, seed)
    ended = time.monotonic()
    return ObservationResult(
        solutions=len(case.solutions),
        latent=compare(case, exact, start.theta.numpy(), seed),
        bridged=compare(case, exact, found.theta.numpy(), seed),
        evidence_error=found.log_evidence - exact.weighted.log_evidence,
        evidence_sd=found.log_evidence_error,
        effective_share=found.effective_share,
        latent_evaluations=start.evaluations,
        latent_responses=latent.found.responses,
        responses=found.evaluations,
        latent_seconds=middle - started,
        bridge_seconds=ended - middle,
    )
