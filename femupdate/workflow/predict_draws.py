"""Posterior draws that a prediction follows, and their response histories."""

import numpy as np
import torch

from femupdate.dynamics.system import System
from femupdate.errors import BuildingError
from femupdate.inference.posterior import Posterior
from femupdate.measurement.record import GroundMotion
from femupdate.progress import Progress
from femupdate.workflow.model import StudyModel
from femupdate.workflow.prediction_inputs import PredictionSettings


def prediction_draws(
    model: StudyModel, posterior: Posterior, settings: PredictionSettings
) -> tuple[torch.Tensor, torch.Tensor, str]:
    """Parameters (n, p) and damping ratios (n,) of some draws, and in words whose ratios.

    Raises:
        BuildingError: a ratio is asked for, but the building's law gives every mode its own.
    """
    theta, zeta = posterior.thinned(settings.samples, settings.seed)
    if model.building.damping.is_rayleigh:
        if settings.damping is not None:
            raise BuildingError(
                f"{model.building.name}: damping.law is rayleigh, which gives every mode its own "
                "ratio; leave --damping out"
            )
        ratio, text = np.full(len(theta), model.building.damping.ratio), "the building's law"
    elif settings.damping is not None:
        ratio, text = np.full(len(theta), settings.damping), f"{settings.damping:g} in all modes"
    elif zeta is not None:
        ratio, text = zeta, f"{zeta.mean():.4f} +- {zeta.std():.4f}, from the posterior"
    else:
        ratio = np.full(len(theta), model.building.damping.ratio)
        text = f"{model.building.damping.ratio:g} in all modes, the building file's"
    return torch.from_numpy(theta), torch.from_numpy(ratio), text


def at_reached_level(
    system: System,
    posterior: Posterior,
    parameters: torch.Tensor,
    zeta: torch.Tensor,
    motion: GroundMotion,
    settings: PredictionSettings,
    show: Progress,
) -> tuple[torch.Tensor, torch.Tensor, tuple[str, ...]]:
    """Draws at the level of motion that they reach, and what is to be said of it."""
    from femupdate.workflow.amplitude import at_own_level, changes_with_level

    if not changes_with_level(system.placed):
        return parameters, zeta, ()
    theta, sizes = system.split(parameters)
    show.start("Finding the level of the motion", len(parameters))
    found = at_own_level(
        system,
        (theta.numpy(), zeta.numpy(), sizes.numpy()),
        motion,
        posterior.settings,
        keep_damping=settings.damping is not None,
        progress=show,
    )
    moved = torch.cat([torch.from_numpy(found.theta), sizes], dim=1)
    return moved, torch.from_numpy(found.zeta), (found.note,)
