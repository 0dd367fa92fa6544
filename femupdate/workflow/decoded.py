"""The latent posterior of a study's building with many stiffness factors."""

import copy
from collections.abc import Callable

from torch import Tensor

from femupdate.inference.decoded import DecodedLikelihood
from femupdate.inference.decoded_chains import (
    DecodedPosterior,
    DecodedSettings,
    Respond,
    decoded_posterior,
)
from femupdate.inference.likelihood import floor_responses, latent_data
from femupdate.measurement.observation import Observation
from femupdate.surrogate.gauss_newton import LatentData
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.workflow.model import StudyModel

# Parameters up to which particles from the prior find a posterior, and Gaussians describe it.
FEW = 10


def sample_decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    observation: Observation,
    draws: int,
    seed: int,
    settings: DecodedSettings | None = None,
    *,
    device: str = "cpu",
    power: float | None = None,
    least_noise: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> DecodedPosterior:
    """Draw theta, and the damping ratio behind it where it is unknown.

    Args:
        surrogate: of the building.
        model: the building.
        observation: on the building's grid.
        draws: kept states of each chain.
        seed: of everything random.
        settings: see `DecodedSettings`.
        device: where to evaluate.
        power: of the likelihood; default the surrogate's own.
        least_noise: standard deviation of ln|H| below which the file's noise is not believed;
            default that of the surrogate's training.
        progress: called with the number of trajectories done since the last call.
    """
    info = surrogate.info
    noise = info.noise_sd if least_noise is None else least_noise
    data = latent_data(observation, info.floors, noise, device)
    mvae = copy.deepcopy(surrogate.mvae).to(device).requires_grad_(False)
    raised = info.likelihood_power if power is None else power
    likelihood = DecodedLikelihood(mvae, data, power=raised)
    bounds = model.zeta_bounds
    prior = model.prior if bounds is None else model.prior.joined("zeta", *bounds)
    respond = _responses(model, observation, data)
    return decoded_posterior(prior.to(device), likelihood, respond, draws, seed, settings, progress)


def _responses(model: StudyModel, observation: Observation, data: LatentData) -> Respond:
    """The building's own, at parameters with the damping ratio last where it is unknown."""
    respond = floor_responses(model.reduced, model.law, observation, data.log_frf)
    size, ratio = model.prior.size, model.building.damping.ratio

    def answer(parameters: Tensor) -> Tensor:
        theta, zeta = parameters[:, :size], parameters[:, size:].flatten()
        return respond(theta, zeta if len(zeta) else theta.new_full((len(theta),), ratio))

    return answer
