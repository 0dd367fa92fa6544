"""The benchmark `latent-size`: how many latent coordinates a building's data can tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from femupdate.dynamics.frf import log_frf_batches
from femupdate.dynamics.modal import modal_data
from femupdate.errors import MeasurementError
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.workflow.model import StudyModel, open_study

from ..machine import Machine, this_machine
from ..result import ResultFiles, markdown_table, write_result
from .study import (
    Respond,
    SizeLoss,
    enough_coordinates,
    sensitive_directions,
    size_losses,
)

NAME = "latent_size"


@dataclass(frozen=True)
class SizePlan:
    """What is looked at.

    Attributes:
        building: shipped name or file.
        floors: observed; all where empty.
        draws: of the prior, for the directions and for the losses alike.
    """

    building: str
    floors: tuple[str, ...] = ()
    draws: int = 200


@dataclass(frozen=True)
class SizeReport:
    """What the benchmark found.

    Attributes:
        machine: it ran on.
        losses: from no coordinate to one less than there are parameters.
        enough: the smallest size that loses less than the data can tell, or one a parameter.
        text: table in Markdown.
        files: written.
    """

    machine: Machine
    losses: Sequence[SizeLoss]
    enough: int
    text: str
    files: ResultFiles


def run_latent_size(
    folder: Path, plan: SizePlan, seed: int = 0, progress: Progress | None = None
) -> SizeReport:
    """Run the benchmark and write its results; the reduced model is kept in the folder.

    Raises:
        MeasurementError: the building has no such floor.
        BuildingError, StudyError: the building cannot be read, or a file cannot be written.
    """
    show, machine = progress or Silent(), this_machine()
    model = open_study(Study(folder / f"{NAME}_{Path(plan.building).stem}_model"), plan.building)
    floors = plan.floors or tuple(model.building.floors)
    respond = _respond(model, floors, show)
    size = model.prior.size
    show.start("Responses", plan.draws * (2 * size + 2))
    generator = torch.Generator().manual_seed(seed)
    value, vector = sensitive_directions(respond, model.prior, plan.draws, generator)
    noise = model.building.observation.noise_sd
    losses = size_losses(respond, model.prior, vector, range(size), noise, plan.draws, generator)
    enough = enough_coordinates(losses, size)
    text = _text(model, floors, plan, losses, enough)
    content = {"plan": plan, "losses": losses, "enough": enough, "eigenvalues": value}
    name = f"{NAME}_{model.building.name}_{'_'.join(plan.floors) or 'all'}"
    files = write_result(folder, name, machine, seed, content, text)
    return SizeReport(machine, losses, enough, text, files)


def _respond(model: StudyModel, floors: Sequence[str], show: Progress) -> Respond:
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
        modal = modal_data(model.reduced, theta, top_frequency_hz=float(frequency[-1]))
        zeta = theta.new_full((len(theta),), model.building.damping.ratio)
        parts = list(log_frf_batches(modal, frequency, model.law, zeta))
        show.advance(len(theta))
        return torch.cat(parts)[:, rows].flatten(1)

    return respond


def _text(
    model: StudyModel,
    floors: Sequence[str],
    plan: SizePlan,
    losses: Sequence[SizeLoss],
    enough: int,
) -> str:
    rows = [(str(one.coordinates), f"{one.rms:.4f}", f"{one.nats:.2f}") for one in losses]
    intro = (
        f"{model.building.name}, {', '.join(floors)}, {len(model.frequency_hz)} frequencies, "
        f"{model.prior.size} parameters, noise {model.building.observation.noise_sd:g} on ln|H|, "
        f"{plan.draws} draws of the prior: what no decoder of so many coordinates, along the "
        "directions that the response goes with most, can follow."
    )
    table = markdown_table(("coordinates", "rms of ln\\|H\\|", "rise of the misfit, nats"), rows)
    chosen = f"Enough: {enough} of {model.prior.size}."
    return "\n\n".join((intro, table, chosen))
