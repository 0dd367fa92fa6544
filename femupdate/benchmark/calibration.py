"""Simulated buildings, their posteriors, and whether those hold the truth as often as they say."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from femupdate.dynamics.frf import log_frf
from femupdate.dynamics.modal import modal_data
from femupdate.inference.bridge import Start, bridge
from femupdate.inference.coverage import density_level, ranks, tarp_level
from femupdate.inference.likelihood import DataLikelihood, LatentLikelihood
from femupdate.inference.power import SimulatedCase
from femupdate.inference.smc import TemperedSmc
from femupdate.measurement.observation import Observation
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.workflow.model import StudyModel

Floats = NDArray[np.float64]

_MODES = 40


@dataclass(frozen=True)
class SimulatedBuilding:
    """A draw from the prior with its noisy response.

    Attributes:
        theta: (p,) stiffness factors.
        observation: of the chosen floors.
    """

    theta: Floats
    observation: Observation


@dataclass(frozen=True)
class Judged:
    """Where the truth of one case lies in one posterior.

    Attributes:
        density: level of the highest-density region that just holds it.
        rank: (p,) share of draws below it.
        tarp: share of draws nearer to a random point.
    """

    density: float
    rank: Floats
    tarp: float


@dataclass(frozen=True)
class CalibrationCase:
    """One simulated building.

    Attributes:
        latent, exact: where its truth lies; `exact` is None where it was not asked for.
        likelihoods: of the latent draws and of the truth.
        misfit: of the reconstruction, see `LatentLikelihood.reconstruction_misfit`.
        effective_share: of the bridge's importance draws; NaN without it.
    """

    latent: Judged
    exact: Judged | None
    likelihoods: SimulatedCase
    misfit: float
    effective_share: float


def simulate(
    model: StudyModel, floors: tuple[str, ...], noise_sd: float, rng: np.random.Generator
) -> SimulatedBuilding:
    """Draw theta and damping from the prior, and the response of some floors with noise."""
    unit = torch.from_numpy(rng.random((1, model.prior.size)))
    theta = model.prior.from_unit(unit)
    low, high = model.zeta_bounds or (model.building.damping.ratio,) * 2
    zeta = torch.tensor([rng.uniform(low, high)], dtype=torch.float64)
    modal = modal_data(
        model.reduced, theta, modes=_MODES, top_frequency_hz=float(model.frequency_hz[-1])
    )
    clean = log_frf(modal, model.frequency_hz, model.law, zeta)[0].numpy()
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
    return SimulatedBuilding(theta[0].numpy(), observation)


def calibration_cases(
    model: StudyModel,
    surrogate: TrainedSurrogate,
    floors: tuple[str, ...],
    count: int,
    seed: int,
    advance: Callable[[], None],
    *,
    particles: int = 1000,
    exact: bool = False,
    power: float | None = None,
) -> list[CalibrationCase]:
    """Sample the posteriors of `count` simulated buildings.

    Args:
        floors: observed.
        exact: also bring every posterior to the data-space likelihood; damping must be fixed.
        power: of the latent likelihood; default the surrogate's own.
    """
    rng = np.random.default_rng(seed)
    cases = []
    for number in range(count):
        building = simulate(model, floors, surrogate.info.noise_sd, rng)
        centre = rng.random(model.prior.size)
        cases.append(
            _case(model, surrogate, building, centre, seed + number, particles, exact, power)
        )
        advance()
    return cases


def _case(
    model: StudyModel,
    surrogate: TrainedSurrogate,
    building: SimulatedBuilding,
    centre: Floats,
    seed: int,
    particles: int,
    exact: bool,
    power: float | None,
) -> CalibrationCase:
    latent = LatentLikelihood(surrogate, building.observation, power=power)
    truth = torch.from_numpy(building.theta)[None]
    start = TemperedSmc(model.prior, latent).run(particles, seed)
    known = SimulatedCase(start.log_likelihood.numpy(), float(latent(truth)[0]))
    judged_exact, share = None, float("nan")
    if exact:
        target = DataLikelihood(
            model.reduced,
            model.law,
            building.observation,
            model.building.damping.ratio,
            precision=torch.float32,
        )
        found = bridge(model.prior, target, Start(start, latent), seed)
        of_target = SimulatedCase(found.log_likelihood.numpy(), float(target(truth)[0]))
        judged_exact = _judge(model, building, found.theta, of_target, centre)
        share = found.effective_share
    return CalibrationCase(
        _judge(model, building, start.theta, known, centre),
        judged_exact,
        known,
        latent.reconstruction_misfit(surrogate.info.noise_sd),
        share,
    )


def _judge(
    model: StudyModel,
    building: SimulatedBuilding,
    draws: torch.Tensor,
    known: SimulatedCase,
    centre: Floats,
) -> Judged:
    unit = model.prior.to_unit(draws).numpy()
    truth = model.prior.to_unit(torch.from_numpy(building.theta)).numpy()
    level = density_level(known.log_likelihood, known.log_likelihood_of_truth, np.ones(len(unit)))
    return Judged(level, ranks(unit, truth), tarp_level(unit, truth, centre))
