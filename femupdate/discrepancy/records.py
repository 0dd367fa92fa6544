"""Measured responses as the effect finder judges them: what counts of them, and how they err."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Flags
from femupdate.building.document import Building
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.thresholds import FIT, MODEL_ERROR
from femupdate.inference.frf_data import (
    FloorForce,
    FrfData,
    frf_data,
    in_alternate_points,
    together,
)
from femupdate.measurement.observation import Observation, at_frequencies


@dataclass(frozen=True, eq=False)
class SecondRecord:
    """What another record shows.

    Attributes:
        observation: its FRFs.
        level: of its motion above the first record's, in doublings; zero where they are alike.
        halves: of it, where it can be parted.
    """

    observation: Observation
    level: float
    halves: tuple[Observation, ...] = ()


def force_data(
    forced: Observation,
    force: FloorForce,
    floors: tuple[str, ...],
    model_error: float,
    use_phase: bool = True,
) -> FrfData:
    """Responses to a force; the points of a table err independently, so every other is a half.

    Args:
        forced: as read.
        force: that acts.
        floors: of the model.
        model_error: of ln|H|, as noise of independent points.
        use_phase: compare phases where they were measured.
    """

    def read(one: Observation, parts: Sequence[Observation]) -> FrfData:
        return frf_data(
            one,
            floors,
            excitation=force,
            use_phase=use_phase,
            model_error=model_error,
            halves=tuple(read(part, ()) for part in parts),
        )

    own = read(forced, forced.halves)
    table = forced.coherence is None
    return in_alternate_points(own) if table and own.points >= FIT.parted else own


def base_data(
    building: Building,
    mesh: MeshError | None,
    observation: Observation,
    use_phase: bool = True,
    halves: Sequence[Observation] = (),
    others: Sequence[SecondRecord] = (),
) -> FrfData:
    """FRFs under base motion, from the first to the last frequency at which any is valid.

    Args:
        building: as its file says.
        mesh: error of the mesh, where it is known.
        observation: on the building's grid.
        use_phase: compare phases where they were measured.
        halves: of the observation, where it can be parted.
        others: further records, at other levels.
    """

    def read(one: Observation, parts: Sequence[Observation]) -> FrfData:
        return frf_data(
            at_frequencies(one, _used(one)),
            building.floors,
            use_phase=use_phase,
            model_error=model_error(building, mesh),
            halves=tuple(read(part, ()) for part in parts),
        )

    data = read(observation, halves)
    for other in others:
        data = together(data, read(other.observation, other.halves), other.level)
    return data


def model_error(building: Building, mesh: MeshError | None) -> float:
    """What mesh and reduction leave in ln|H|, as noise of independent points."""
    return MODEL_ERROR.frame if building.kind != "shear" and mesh is None else MODEL_ERROR.stick


def _used(observation: Observation) -> Flags:
    """The frequencies that say something, and those between them."""
    seen = np.flatnonzero(observation.valid.any(axis=0))
    used = np.zeros(observation.frequency_hz.size, dtype=bool)
    used[seen[0] : seen[-1] + 1] = True
    return used & _measured(observation)


def _measured(observation: Observation) -> Flags:
    """Where a table coarser than the grid has its points: straight lines between are no data."""
    frequency = observation.frequency_hz
    spacing = float(np.median(np.diff(frequency)))
    coarse = observation.resolution_hz or spacing
    if observation.coherence is not None or coarse < 1.5 * spacing:
        return np.ones(frequency.size, dtype=bool)
    distance = np.abs(frequency / coarse - np.round(frequency / coarse)) * coarse
    return np.asarray(distance < 0.5 * spacing * (1.0 + 1e-9))
