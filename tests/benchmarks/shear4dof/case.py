"""The four-story shear building seen at its roof: a posterior with four modes, known exactly.

Published as a test of samplers; the noise is the authors' own (seed 101), so their posterior and
ours are of the same observation.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.stats import norm

from femupdate.arrays import Floats
from femupdate.building import shear_operators
from femupdate.inference import STATED
from femupdate.inference.frf_data import base_logs
from femupdate.inference.importance import LogLikelihood, WeightedDraws, draws_about_particles
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.likelihood import likelihood_of
from femupdate.inference.smc import TemperedSmc
from femupdate.measurement import Observation
from femupdate.surrogate import Surrogate
from femupdate.workflow import StudyModel

from .equivalent import equivalent_stiffness
from .metrics import ModeSummary, mode_summary

NAME = "shear_4dof"
ROOF = "RF"
NOISE_SD = 0.2
_AUTHORS_SEED = 101

# Table 1 of the paper.
PUBLISHED_SOLUTIONS = np.array(
    [
        [1.0, 1.0, 1.0, 1.0],
        [1.72206, 0.63637, 1.30144, 0.70116],
        [2.0, 1.0, 0.5, 1.0],
        [2.63969, 0.64718, 0.81280, 0.72018],
    ]
)


@dataclass(frozen=True)
class Case:
    """One observation, its truth and all stiffness factors with the same roof response."""

    observation: Observation  # of the roof
    theta: Floats  # (4,) truth
    solutions: Floats  # (m, 4) within the prior's box, the truth among them
    sd: Floats  # (m, 4) standard deviations at each solution, by the misfit's curvature


@dataclass(frozen=True)
class ExactPosterior:
    """The data-space posterior of a case by importance sampling."""

    weighted: WeightedDraws  # all draws with their weights
    theta: Floats  # (n, 4) independent, equally weighted draws
    modes: ModeSummary  # how they share among the case's solutions


@dataclass(frozen=True)
class Shear4dof:
    """The building with its surrogate, and one observation with its exact posterior."""

    model: StudyModel
    surrogate: Surrogate
    case: Case
    exact: ExactPosterior

    def latent(self, case: Case | None = None) -> LatentLikelihood:
        """The latent likelihood of this observation, or of another one."""
        observation = (case or self.case).observation
        return LatentLikelihood(self.surrogate, self.model.system, observation)


def equivalent_theta(model: StudyModel, theta: ArrayLike) -> Floats:
    """Factors (m, p) in the prior's box with the roof response of theta (p,)."""
    terms, mass = shear_operators(model.building)
    springs = np.array([np.abs(term).max() for term in terms])
    found = equivalent_stiffness(springs * np.asarray(theta), np.diag(mass)) / springs
    low, high = model.prior.lower.numpy(), model.prior.upper.numpy()
    return found[((found > low) & (found < high)).all(axis=1)]


def roof_log_frf(model: StudyModel, theta: ArrayLike) -> Floats:
    """ln|H| (n, floors, k) without noise at theta (n, p)."""
    points = torch.from_numpy(np.atleast_2d(np.asarray(theta, dtype=float)))
    ratio = torch.full((len(points),), model.building.damping.ratio, dtype=torch.float64)
    return model.system.log_frf(points, ratio, model.frequency_hz).numpy()


def authors_case(model: StudyModel) -> Case:
    """All factors one, and the authors' noise."""
    theta = np.ones(model.prior.size)
    noise = norm.rvs(size=len(model.frequency_hz), random_state=_AUTHORS_SEED) * NOISE_SD
    return _case(model, theta, noise)


def random_case(model: StudyModel, rng: np.random.Generator) -> Case:
    """Factors from the prior and fresh noise.

    Solutions closer than five hundredths to another, or to a bound of the box, would not make
    modes that can be told apart: such factors are drawn again.
    """
    low, high = model.prior.lower.numpy(), model.prior.upper.numpy()
    while True:
        theta = rng.uniform(low, high)
        case = _case(model, theta, NOISE_SD * rng.normal(size=len(model.frequency_hz)))
        gaps = np.abs(case.solutions[:, None] - case.solutions).max(axis=-1)
        np.fill_diagonal(gaps, np.inf)
        edge = np.minimum(case.solutions - low, high - case.solutions).min()
        if min(gaps.min(), edge) > 0.05:
            return case


def _case(model: StudyModel, theta: Floats, noise: Floats) -> Case:
    roof = roof_log_frf(model, theta)[0, -1] + noise
    shape = (1, roof.size)
    observation = Observation(
        model.frequency_hz.numpy(),
        (ROOF,),
        roof[None],
        np.full(shape, NOISE_SD),
        np.ones(shape, dtype=bool),
        source="four-story benchmark",
    )
    solutions = equivalent_theta(model, theta)
    return Case(observation, theta, solutions, _curvature_sd(model, solutions))


def _curvature_sd(model: StudyModel, solutions: Floats) -> Floats:
    """Standard deviations (m, p) of Gaussians with the curvature of the misfit at solutions."""
    step = 1e-5
    size = solutions.shape[1]
    ends = solutions[:, None, None] + step * np.stack([np.eye(size), -np.eye(size)])
    roof = roof_log_frf(model, ends.reshape(-1, size))[:, -1].reshape(*ends.shape[:3], -1)
    slope = (roof[:, 0] - roof[:, 1]) / (2.0 * step * NOISE_SD)  # (m, p, k)
    covariance = np.linalg.inv(slope @ slope.transpose(0, 2, 1))
    return np.asarray(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))


def data_likelihood(model: StudyModel, case: Case) -> LogLikelihood:
    """exp(-|r|^2 / 2 sigma^2) of the roof, in the factors; the damping ratio is known."""
    data = base_logs(case.observation, model.system, table=STATED)
    assert data.logs is not None
    data = replace(data, logs=replace(data.logs, precision=torch.float32))
    likelihood = likelihood_of((data,), model.system, model.parameters)

    def of_factors(theta: torch.Tensor) -> torch.Tensor:
        ratio = theta.new_full((len(theta), 1), model.building.damping.ratio)
        return likelihood(torch.cat([theta, ratio], dim=1))

    return of_factors


def exact_posterior(
    model: StudyModel, case: Case, draws: int = 50_000, seed: int = 0, particles: int = 2000
) -> ExactPosterior:
    """Sample the data-space posterior: tempering from the prior, then importance draws.

    Some three in five importance draws are kept by rejection, so twice as many are made.
    """
    target = data_likelihood(model, case)
    found = TemperedSmc(model.prior, target).run(particles, seed)
    weighted = draws_about_particles(model.prior, target, found.theta, 2 * draws, seed + 1)
    theta = weighted.resampled(draws, seed + 2).theta.numpy()
    return ExactPosterior(weighted, theta, case_modes(case, theta))


def case_modes(case: Case, theta: ArrayLike) -> ModeSummary:
    """Share draws (n, 4) out to the case's solutions."""
    return mode_summary(theta, case.solutions, case.sd)
