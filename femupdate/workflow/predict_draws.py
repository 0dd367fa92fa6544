"""Posterior draws that a prediction follows, and their response histories."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from femupdate.arrays import Integers
from femupdate.dynamics.system import System
from femupdate.errors import BuildingError
from femupdate.inference.event_scatter import DEFAULT, EventScatter
from femupdate.inference.posterior import Posterior
from femupdate.measurement.record import GroundMotion
from femupdate.progress import Progress
from femupdate.report.scale import plus_minus
from femupdate.seeds import Seed
from femupdate.workflow.model import StudyModel
from femupdate.workflow.prediction_inputs import PredictionSettings

LAW = "the building's law"


@dataclass(frozen=True, eq=False)
class PredictionDraws:
    """Posterior draws that a prediction follows.

    Attributes:
        rows: (n,) which draws.
        parameters: (n, p) stiffness factors and sizes of effects.
        zeta: (n,) damping ratios.
        damping: whose ratios these are, in words.
    """

    rows: Integers
    parameters: torch.Tensor
    zeta: torch.Tensor
    damping: str


def prediction_draws(
    model: StudyModel, posterior: Posterior, settings: PredictionSettings
) -> PredictionDraws:
    """Some draws with their damping ratios.

    Raises:
        BuildingError: a ratio is asked for, but the building's law gives every mode its own.
    """
    rows = posterior.rows(settings.samples, settings.seed)
    theta, zeta = posterior.thinned(settings.samples, settings.seed)
    if model.building.damping.is_rayleigh:
        if settings.damping is not None:
            raise BuildingError(
                f"{model.building.name}: damping.law is rayleigh, which gives every mode its own "
                "ratio; leave --damping out"
            )
        ratio, text = np.full(len(theta), model.building.damping.ratio), LAW
    elif settings.damping is not None:
        ratio, text = np.full(len(theta), settings.damping), f"{settings.damping:g} in all modes"
    elif zeta is not None:
        ratio, text = zeta, f"{plus_minus(zeta.mean(), zeta.std())}, from the posterior"
    else:
        ratio = np.full(len(theta), model.building.damping.ratio)
        text = f"{model.building.damping.ratio:g} in all modes, the building file's"
    return PredictionDraws(rows, torch.from_numpy(theta), torch.from_numpy(ratio), text)


@dataclass(frozen=True)
class PredictionTask:
    """What histories are computed of."""

    system: System
    posterior: Posterior
    motion: GroundMotion
    settings: PredictionSettings
    show: Progress


def in_another_event(task: PredictionTask, draws: PredictionDraws, seed: Seed) -> PredictionDraws:
    """The draws as the building may be in another event."""
    posterior, settings = task.posterior, task.settings
    theta, sizes = task.system.split(draws.parameters)
    box = [torch.from_numpy(end[: theta.shape[1]]) for end in (posterior.lower, posterior.upper)]
    scatter = chosen_scatter(posterior, settings, draws.rows)
    if settings.damping is not None or draws.damping == LAW:
        scatter = replace(scatter, damping=0.0, damped=0.0)
    moved, zeta = scatter.next_event(theta, draws.zeta, (box[0], box[1]), seed)
    return replace(draws, parameters=torch.cat([moved, sizes], dim=1), zeta=zeta)


def chosen_scatter(
    posterior: Posterior, settings: PredictionSettings, rows: Integers
) -> EventScatter:
    """What was asked for, else what several runs have taught, else the default."""
    found = DEFAULT if posterior.scatter is None else posterior.scatter.of(rows)
    if settings.scatter is not None:
        found = replace(found, stiffness=settings.scatter)
    if settings.damping_scatter is not None:
        found = replace(found, damping=settings.damping_scatter)
    return found


def at_reached_level(
    task: PredictionTask, draws: PredictionDraws
) -> tuple[torch.Tensor, torch.Tensor, tuple[str, ...]]:
    """Draws at the level of motion that they reach, and what is to be said of it."""
    from femupdate.workflow.amplitude import at_own_level, changes_with_level

    if not changes_with_level(task.system.placed):
        return draws.parameters, draws.zeta, ()
    theta, sizes = task.system.split(draws.parameters)
    task.show.start("Finding the level of the motion", len(theta))
    found = at_own_level(
        task.system,
        (theta.numpy(), draws.zeta.numpy(), sizes.numpy()),
        task.motion,
        task.posterior.settings,
        keep_damping=task.settings.damping is not None,
        progress=task.show,
    )
    moved = torch.cat([torch.from_numpy(found.theta), sizes], dim=1)
    return moved, torch.from_numpy(found.zeta), (found.note,)
