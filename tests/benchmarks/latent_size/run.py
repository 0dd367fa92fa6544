"""The benchmark `latent-size`: how many latent coordinates a building's data can tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from femupdate.dynamics.system import Responses
from femupdate.errors import MeasurementError
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.workflow.model import StudyModel, open_study

from ..result import Job, Report, markdown_table
from .study import Respond, SizeLoss, enough_coordinates, sensitive_directions, size_losses

NAME = "latent_size"


@dataclass(frozen=True)
class LatentSizePlan:
    """What is looked at.

    Attributes:
        building: shipped name or file.
        floors: observed; all where empty.
        draws: of the prior, for the directions and for the losses alike.
    """

    building: str
    floors: tuple[str, ...] = ()
    draws: int = 200


def run_latent_size(job: Job, plan: LatentSizePlan) -> Report:
    """Run the benchmark and write its results; the reduced model is kept in the folder.

    Raises:
        MeasurementError: the building has no such floor.
        BuildingError, StudyError: the building cannot be read, or a file cannot be written.
    """
    study = Study(job.folder / f"{NAME}_{Path(plan.building).stem}_model")
    model = open_study(study, plan.building)
    floors = plan.floors or tuple(model.building.floors)
    respond = _respond(model, floors, job.progress)
    size = model.prior.size
    job.progress.start("Responses", plan.draws * (2 * size + 2))
    generator = torch.Generator().manual_seed(job.seed)
    value, vector = sensitive_directions(respond, model.prior, plan.draws, generator)
    noise = model.building.observation.noise_sd
    losses = size_losses(respond, model.prior, vector, range(size), noise, plan.draws, generator)
    enough = enough_coordinates(losses, size)
    return job.write(
        f"{NAME}_{model.building.name}_{'_'.join(plan.floors) or 'all'}",
        {"plan": plan, "losses": losses, "enough": enough, "eigenvalues": value},
        _text(model, floors, plan.draws, losses, enough),
        answer={"enough": enough, "nats": [one.nats for one in losses]},
    )


def _respond(model: StudyModel, floors: Sequence[str], progress: Progress) -> Respond:
    """ln|H| of the observed floors, for the damping ratio of the building's file."""
    missing = [name for name in floors if name not in model.reduced.floors]
    if missing:
        raise MeasurementError(
            f"{model.building.name} has no floor {', '.join(missing)} to observe; it has "
            f"{', '.join(model.reduced.floors)}"
        )
    rows = [model.reduced.floors.index(name) for name in floors]
    frequency = model.frequency_hz

    def respond(theta: Tensor) -> Tensor:
        # All modes: which ones floors feel most changes from place to place.
        zeta = theta.new_full((len(theta),), model.building.damping.ratio)
        values = model.system.log_frf(theta, zeta, frequency, Responses(floors=tuple(rows)))
        progress.advance(len(theta))
        return values.flatten(1)

    return respond


def _text(
    model: StudyModel, floors: Sequence[str], draws: int, losses: Sequence[SizeLoss], enough: int
) -> str:
    rows = [(str(one.coordinates), f"{one.rms:.4f}", f"{one.nats:.2f}") for one in losses]
    intro = (
        f"{model.building.name}, {', '.join(floors)}, {len(model.frequency_hz)} frequencies, "
        f"{model.prior.size} parameters, noise {model.building.observation.noise_sd:g} on ln|H|, "
        f"{draws} draws of the prior: what no decoder of so many coordinates, along the "
        "directions that the response goes with most, can follow."
    )
    table = markdown_table(("coordinates", "rms of ln\\|H\\|", "rise of the misfit, nats"), rows)
    return "\n\n".join((intro, table, f"Enough: {enough} of {model.prior.size}."))
