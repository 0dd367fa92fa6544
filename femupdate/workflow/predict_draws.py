"""Posterior draws that a prediction follows, and their response histories."""

from dataclasses import dataclass, replace

import torch

from femupdate.arrays import Integers
from femupdate.dynamics.system import System
from femupdate.errors import BuildingError
from femupdate.inference.event_scatter import DEFAULT, EventScatter
from femupdate.inference.parameters import Values
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
        values: of the parameters.
        damping: whose ratios these are, in words.
    """

    rows: Integers
    values: Values
    damping: str


def prediction_draws(
    model: StudyModel, posterior: Posterior, settings: PredictionSettings
) -> PredictionDraws:
    """Some draws with their damping ratios.

    Raises:
        BuildingError: a ratio is asked for, but the building's law gives every mode its own.
    """
    rows = posterior.rows(settings.samples, settings.seed)
    values = posterior.parameters.split(posterior.thinned(settings.samples, settings.seed))
    ratio, zeta = model.building.damping.ratio, values.zeta
    if model.building.damping.is_rayleigh:
        if settings.damping is not None:
            raise BuildingError(
                f"{model.building.name}: damping.law is rayleigh, which gives every mode its own "
                "ratio; leave --damping out"
            )
        text = LAW
    elif settings.damping is not None:
        zeta, text = torch.full_like(zeta, settings.damping), f"{settings.damping:g} in all modes"
    elif posterior.zeta_samples is not None:
        drawn = zeta.numpy()
        text = f"{plus_minus(drawn.mean(), drawn.std())}, from the posterior"
    else:
        text = f"{ratio:g} in all modes, the building file's"
    return PredictionDraws(rows, replace(values, zeta=zeta), text)


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
    values, factors = draws.values, posterior.parameters.of("stiffness")
    scatter = chosen_scatter(posterior, settings, draws.rows)
    if settings.damping is not None or draws.damping == LAW:
        scatter = replace(scatter, damping=0.0, damped=0.0)
    box = factors.lower, factors.upper
    moved, zeta = scatter.next_event(values.theta, values.zeta, box, seed)
    return replace(draws, values=replace(values, theta=moved, zeta=zeta))


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
) -> tuple[Values, tuple[str, ...]]:
    """Draws at the level of motion that they reach, and what is to be said of it."""
    from femupdate.workflow.amplitude import at_own_level, changes_with_level

    values = draws.values
    if not changes_with_level(task.system.placed):
        return values, ()
    task.show.start("Finding the level of the motion", len(values.zeta))
    found = at_own_level(
        task.system,
        (values.theta.numpy(), values.zeta.numpy(), values.sizes.numpy()),
        task.motion,
        task.posterior.settings,
        keep_damping=task.settings.damping is not None,
        progress=task.show,
    )
    theta, zeta = torch.from_numpy(found.theta), torch.from_numpy(found.zeta)
    return replace(values, theta=theta, zeta=zeta), (found.note,)
