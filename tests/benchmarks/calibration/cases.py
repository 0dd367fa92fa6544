"""Simulated buildings, their posteriors, and where the truth lies in those."""

from dataclasses import dataclass

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.dynamics import Responses
from femupdate.inference import STATED
from femupdate.inference.frf_data import base_logs
from femupdate.inference.importance import SamplerRun, draws_about_particles
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.likelihood import Likelihood, cost_of_scatter, likelihood_of
from femupdate.inference.smc import LogLikelihood, TemperedSmc
from femupdate.measurement import Observation
from femupdate.surrogate import Surrogate
from femupdate.surrogate.storage import ANY_FLOORS
from femupdate.workflow import StudyModel
from femupdate.workflow.likelihoods import on_fewer_modes

_MODES = 40


@dataclass(frozen=True)
class SimulatedBuilding:
    """A draw from the prior with its noisy response."""

    theta: Floats  # (p,) stiffness factors
    zeta: float  # damping ratio
    observation: Observation  # of the chosen floors


@dataclass(frozen=True)
class Widths:
    """The latent posterior against the data-space posterior of the same data."""

    ratio: Floats  # (p,) standard deviation over the exact one
    shift: Floats  # (p,) of the mean, in exact standard deviations


@dataclass(frozen=True, kw_only=True)
class CalibrationCase:
    """One simulated building."""

    # Levels of the highest-density regions that just hold the truth, see `level_of`.
    latent: float
    exact: float | None  # None where it was not asked for
    misfit: float  # of the best response, see `FoundLatent`
    responses: int  # of the building that the latent likelihood took
    effective_share: float  # of the bridge's importance draws; NaN without it
    widths: Widths | None  # the latent posterior against the data-space one; None without it


@dataclass(frozen=True, kw_only=True)
class CalibrationPlan:
    """What is simulated."""

    building: str = "shear_4dof"  # shipped name
    floors: tuple[str, ...] = ()  # observed; the roof where empty, `ANY_FLOORS` for random sets
    cases: int = 200  # simulated buildings
    particles: int = 1000  # of each posterior
    beside: int | None = None  # the first so many also get the data-space posterior; None: all
    noise_sd: float | None = None  # of ln|H|; default that of the surrogate's training

    @property
    def compared(self) -> int:
        """How many cases also get the data-space posterior."""
        return self.cases if self.beside is None else self.beside


def simulate(
    model: StudyModel, floors: tuple[str, ...], noise_sd: float, rng: np.random.Generator
) -> SimulatedBuilding:
    """Draw theta and damping from the prior, and the response of some floors with noise."""
    unit = torch.from_numpy(rng.random((1, model.prior.size)))
    theta = model.prior.from_unit(unit)
    low, high = model.damping.lower, model.damping.upper
    zeta = torch.tensor([rng.uniform(low, high)], dtype=torch.float64)
    clean = _response(model, theta, zeta)[0].numpy()
    rows = [model.building.floors.index(name) for name in floors]
    shape = (len(rows), clean.shape[1])
    observation = Observation(
        model.frequency_hz.numpy(),
        floors,
        clean[rows] + noise_sd * rng.normal(size=shape),
        np.full(shape, noise_sd),
        np.ones(shape, dtype=bool),
        source="simulation",
    )
    return SimulatedBuilding(theta[0].numpy(), float(zeta[0]), observation)


def _response(model: StudyModel, theta: torch.Tensor, zeta: torch.Tensor) -> torch.Tensor:
    """ln|H| (n, f, k) of all floors without noise."""
    return model.system.log_frf(theta, zeta, model.frequency_hz, Responses(modes=_MODES))


def calibration_case(
    model: StudyModel, surrogate: Surrogate, plan: CalibrationPlan, seed: int, number: int
) -> CalibrationCase:
    """Simulate one building and sample its posteriors; the data-space one knows no damping."""
    rng = np.random.default_rng([seed, number])
    noise_sd = plan.noise_sd or surrogate.info.noise_sd
    floors = plan.floors or (model.building.floors[-1],)
    if floors == (ANY_FLOORS,):  # one at least, each as likely as not
        chosen = rng.random(len(model.building.floors)) < 0.5
        chosen[rng.integers(len(chosen))] = True
        floors = tuple(np.array(model.building.floors)[chosen].tolist())
    building = simulate(model, floors, noise_sd, rng)
    seed = 1009 * seed + number
    latent = LatentLikelihood(surrogate, model.system, building.observation, least_noise=noise_sd)
    start = TemperedSmc(model.prior, latent).run(plan.particles, seed)
    exact, widths, share = None, None, float("nan")
    if number < plan.compared:
        draws, exact, share = _exact(model, building, start, seed)
        theta = draws[:, : model.prior.size]
        widths = _widths(start.theta, theta)
    return CalibrationCase(
        latent=level_of(start, latent, building.theta),
        exact=exact,
        misfit=latent.found.misfit,
        responses=latent.found.responses,
        effective_share=share,
        widths=widths,
    )


def _exact(
    model: StudyModel, building: SimulatedBuilding, start: SamplerRun, seed: int
) -> tuple[torch.Tensor, float, float]:
    """Draws from the data-space posterior, the truth's level in it, and its effective share.

    The draws are of theta (n, p), with the damping ratio as one more column where it is unknown.
    """
    prior = model.parameters
    target = on_fewer_modes(stated_likelihood(model, building.observation))
    truth = np.append(building.theta, building.zeta)
    # The latent likelihood does not know zeta: its posterior there is the prior.
    generator = torch.Generator().manual_seed(seed)
    zeta = prior.of("damping").sample(len(start.theta), generator)
    particles = torch.cat([start.theta, zeta], dim=1)
    weighted = draws_about_particles(prior, target, particles, 4 * len(particles), seed)
    found = weighted.resampled(len(particles), seed)
    return found.theta, level_of(found, target, truth), found.effective_share


def stated_likelihood(model: StudyModel, observation: Observation) -> Likelihood:
    """That of FRFs under base motion as if the model were right and the noise as stated."""
    data = base_logs(observation, model.system, table=STATED)
    cost = cost_of_scatter(observation, data)
    return likelihood_of((data,), model.system, model.parameters, cost)


def level_of(found: SamplerRun, log_likelihood: LogLikelihood, truth: Floats) -> float:
    """Credibility level of the highest-density region that just holds true parameters (p,).

    Of a uniform prior. Uniform over cases where posteriors are right.
    """
    at_truth = float(log_likelihood(torch.from_numpy(truth)[None])[0])
    return float((found.log_likelihood > at_truth).double().mean())


def _widths(latent: torch.Tensor, exact: torch.Tensor) -> Widths:
    sd = exact.std(dim=0)
    ratio, shift = latent.std(dim=0) / sd, (latent.mean(dim=0) - exact.mean(dim=0)) / sd
    return Widths(ratio.numpy(), shift.numpy())
