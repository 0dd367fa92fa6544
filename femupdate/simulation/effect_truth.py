"""A building with an effect put into its full model, seen by its accelerometers one by one.

The effect is put into the full equations of a finer mesh; what moves is followed by the shapes
that the forces in the changed structure drive. Histories come from the complex FRFs of every sensor
at every frequency of the padded record, which is exact for a linear structure.
"""

from dataclasses import dataclass

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building.schema import Building
from femupdate.building.shear import ShearBuilding
from femupdate.dynamics.changing_history import RunMotion, changing_histories
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.equations import Sensors, driven_system
from femupdate.dynamics.projection import lumped
from femupdate.dynamics.system import System
from femupdate.dynamics.transformed import transformed_sensors
from femupdate.effects.effect import Placed
from femupdate.effects.structure import Structure, require_story_factors, structure_of
from femupdate.errors import ModelError
from femupdate.fe.model import DOF_PER_NODE
from femupdate.measurement.columns import Channel
from femupdate.measurement.record import GroundMotion
from femupdate.simulation.full_model import SensorModel, SensorPoints, sensor_model, sensor_places

_REST = 1e-5  # share to which motion has decayed behind the record


@dataclass(frozen=True, eq=False)
class Truth:
    """A building with effects at one theta.

    Attributes:
        seen: its sensors and modes.
        system: its response, a row for every sensor.
        theta: (p,) stiffness factors; none where they are in the system already.
        values: parameters of the effects.
    """

    seen: SensorModel
    system: System
    theta: Floats
    values: tuple[float, ...]

    def respond(self, zeta: float, motion: GroundMotion) -> Floats:
        """Absolute accelerations (c, n), m/s2, under a base motion.

        Raises:
            ModelError: a structure that changes in the run has an instrument or a damper beside.
        """
        sample = (
            torch.from_numpy(self.theta)[None],
            torch.tensor([zeta], dtype=torch.float64),
            torch.tensor([self.values], dtype=torch.float64).reshape(1, -1),
        )
        if not self.system.changes_in_run:
            return transformed_sensors(self.system, sample, motion.inputs, motion.time_step, _REST)
        instruments = any(one.effect.instrument for one in self.system.placed)
        if instruments or self.system.complex_modes:
            raise ModelError(
                "a structure that changes in the run is followed without instruments, dampers and"
                " appendages that err or act beside; simulate them apart"
            )
        theta, ratio, sizes = sample
        run = RunMotion(motion.inputs, motion.time_step)
        (found,) = changing_histories(self.system, torch.cat([theta, sizes], dim=1), ratio, run)
        return found.floor_acceleration[0]


@dataclass(frozen=True, eq=False)
class FineModel:
    """What of a truth depends on neither theta nor the effects: a building's own equations.

    Attributes:
        building: with every sensor listed.
        structure: the full model; a frame is meshed finer than for the updating.
        channels: (c,) the sensors, floor by floor.
        places: (c,) where each one is.
        mesh_size: m; None for a shear building.
    """

    building: Building
    structure: Structure
    channels: tuple[Channel, ...]
    places: tuple[str, ...]
    mesh_size: float | None


def fine_model(
    building: Building, mesh_size: float | None = None, sensors: SensorPoints | None = None
) -> FineModel:
    """Mesh and assemble a building.

    Args:
        mesh_size: m; two fifths of the building's own where None.

    Raises:
        BuildingError, ModelError: as `sensor_model`.
    """
    require_story_factors(building)
    if isinstance(building, ShearBuilding):
        ones = np.ones(len(building.stories))
        seen = sensor_model(building, ones, 1.0, mesh_size=mesh_size, sensors=sensors)
        return FineModel(building, structure_of(building), seen.channels, seen.places, None)
    sensed, size, channels, places = sensor_places(building, mesh_size, sensors)
    return FineModel(sensed, structure_of(sensed, size), channels, places, size)


def effect_truth(
    fine: FineModel,
    theta: Floats,
    effects: tuple[tuple[Placed, tuple[float, ...]], ...],
    law: DampingLaw,
    top_hz: float,
    turns: bool = False,
) -> Truth:
    """Put effects into the full model of a building.

    Args:
        theta: (p,) stiffness factors.
        effects: each at its place, with all its parameters.
        top_hz: up to where the response to every force must be right.
        turns: whether the base turns of itself.

    Raises:
        ModelError: the structure is a mechanism, or theta does not fit.
    """
    structure, placed = fine.structure, tuple(one for one, _ in effects)
    values = tuple(v for _, own in effects for v in own)
    if structure.operators is None or structure.mesh is None:
        reduced = lumped(structure)
        system = System(reduced.model, law, placed, tuple(reduced.terms(one) for one in placed))
        return Truth(sensor_model(fine.building, theta, top_hz), system, theta, values)
    found = driven_system(
        structure,
        placed,
        tuple(one.effect.terms(structure, one.place) for one in placed),
        theta,
        np.array(values),
        top_hz,
        law,
        _sensors(fine),
        turns,
    )
    below = found.frequency_hz < top_hz
    participation = (found.shapes[:, below].T @ structure.rigid_force[:, 0]) ** 2
    seen = SensorModel(
        model=found.system.model,
        channels=fine.channels,
        places=fine.places,
        frequency_hz=found.frequency_hz[below],
        effective_mass=participation / structure.rigid_mass[0, 0],
        direction="xy"[structure.direction],
        mesh_size=fine.mesh_size,
        dof=len(structure.axis),
    )
    return Truth(seen, found.system, np.zeros(0), values)


def _sensors(fine: FineModel) -> Sensors:
    """Every sensor of a frame along the motion."""
    structure, mesh, operators = fine.structure, fine.structure.mesh, fine.structure.operators
    if mesh is None or operators is None:
        raise AssertionError("a frame has a mesh")
    nodes = np.concatenate([mesh.floor_nodes[floor] for floor in mesh.floors])
    rows = np.zeros((len(nodes), operators.dof))
    rows[np.arange(len(nodes)), DOF_PER_NODE * nodes + structure.direction] = 1.0
    floors = tuple(channel.floor for channel in fine.channels)
    heights = np.array([structure.levels[structure.floors.index(floor)] for floor in floors])
    return Sensors(floors, operators.gather(rows.T).T, heights)
