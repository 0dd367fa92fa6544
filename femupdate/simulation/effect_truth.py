"""A building with an effect put into its full model, seen by its accelerometers one by one.

The effect is put into the full equations of a finer mesh; what moves is followed by the shapes
that the forces in the changed structure drive. Histories come from the complex FRFs of every sensor
at every frequency of the padded record, which is exact for a linear structure.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.sparse import csc_matrix

from femupdate.arrays import Complexes, Floats
from femupdate.building.schema import Building
from femupdate.building.shear import ShearBuilding
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import EffectSystem, ReducedStructure, reduce_terms
from femupdate.effects.effect import UNSCALED, Placed, Terms
from femupdate.effects.structure import ROTATION, Structure, structure_of
from femupdate.fe.driven import driven_shapes
from femupdate.fe.factorization import factorize
from femupdate.fe.model import DOF_PER_NODE
from femupdate.measurement.columns import Channel
from femupdate.measurement.record import GroundMotion
from femupdate.simulation.full_model import SensorModel, SensorPoints, sensor_model, sensor_places

# Silence behind the record, so that its end does not disturb its beginning: until the slowest
# motion has decayed to this share, within limits.
_REST, _SHORTEST_S, _LONGEST_S = 1e-5, 5.0, 600.0
_BLOCK = 2048  # frequencies at a time


@dataclass(frozen=True, eq=False)
class Truth:
    """A building with effects at one theta.

    Attributes:
        seen: its sensors and modes.
        system: its response, a row for every sensor.
        theta: (p,) stiffness factors.
        values: parameters of the effects.
    """

    seen: SensorModel
    system: EffectSystem
    theta: Floats
    values: tuple[float, ...]

    def frf(self, frequency_hz: Floats, zeta: float) -> Complexes:
        """Complex FRFs (c, k) of every sensor."""
        theta = torch.from_numpy(np.atleast_2d(self.theta))
        sizes = torch.tensor([self.values], dtype=torch.float64).reshape(1, -1)
        ratio = torch.tensor([zeta], dtype=torch.float64)
        blocks = np.array_split(frequency_hz, max(1, len(frequency_hz) // _BLOCK))
        parts = [self.system.frf(theta, ratio, sizes, torch.from_numpy(b))[0] for b in blocks]
        return torch.cat(parts, dim=1).numpy()

    def respond(self, zeta: float, motion: GroundMotion) -> Floats:
        """Absolute accelerations (c, n), m/s2, under a base motion."""
        samples = len(motion.acceleration)
        padded = samples + round(self._rest(zeta) / motion.time_step)
        spectrum = np.fft.rfft(motion.acceleration, padded)
        frequency = np.asarray(np.fft.rfftfreq(padded, motion.time_step), dtype=np.float64)
        frequency[0] = 1e-3 * frequency[1]  # the rigid limit, without a division by zero
        response = np.fft.irfft(self.frf(frequency, zeta) * spectrum, padded, axis=1)
        return np.asarray(response[:, :samples])

    def _rest(self, zeta: float) -> float:
        """How long motion lasts after the record, s."""
        theta = torch.from_numpy(np.atleast_2d(self.theta))
        sizes = torch.tensor([self.values], dtype=torch.float64).reshape(1, -1)
        modes = self.system.modes(theta, torch.tensor([zeta], dtype=torch.float64), sizes)
        rate = 2.0 * np.pi * modes.frequency_hz * modes.ratio  # of decay, 1/s
        longest = -np.log(_REST) / float(rate.min())
        return float(np.clip(longest, _SHORTEST_S, _LONGEST_S))


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
        building: of either kind.
        mesh_size: m; half of the building's own where None.
        sensors: as for `sensor_model`.

    Raises:
        BuildingError, ModelError: as `sensor_model`.
    """
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
) -> Truth:
    """Put effects into the full model of a building.

    Args:
        fine: the full model.
        theta: (p,) stiffness factors.
        effects: each at its place, with all its parameters.
        law: of the damping.
        top_hz: up to where the response to every force must be right.

    Raises:
        ModelError: the structure is a mechanism, or theta does not fit.
    """
    structure = fine.structure
    placed = tuple(one for one, _ in effects)
    values = tuple(v for _, own in effects for v in own)
    terms = tuple(one.effect.terms(structure, one.place) for one in placed)
    if structure.operators is None or structure.mesh is None:
        seen = sensor_model(fine.building, theta, top_hz)
        reduced = structure_on(structure, np.diag(structure.points.mass**-0.5))
        projected = tuple(reduce_terms(reduced, own) for own in terms)
        return Truth(seen, EffectSystem(reduced, law, placed, projected), theta, values)
    stiffness, mass, force = _changed(structure, theta, terms, values, placed)
    rocks = any(own.pitch or own.flexibility[ROTATION] for own in terms)
    ports = [own.port.row for own in terms if own.port is not None]
    forces = np.column_stack([force if rocks else force[:, :1], *ports])
    found = driven_shapes(factorize(stiffness), mass, forces, structure.floor_rows, top_hz)
    heavier = any(own.mass is not None for own in terms)
    basis = _orthonormal(structure, found.shapes) if heavier else found.shapes
    reduced = structure_on(structure, basis)
    nodes = np.concatenate([structure.mesh.floor_nodes[floor] for floor in structure.mesh.floors])
    rows = structure.operators.expand(basis)[DOF_PER_NODE * nodes + structure.direction]
    floors = tuple(channel.floor for channel in fine.channels)
    by_sensor = replace(reduced.model, floor_shapes=rows, floors=floors)
    heights = [structure.levels[structure.floors.index(floor)] for floor in floors]
    reduced = ReducedStructure(
        structure,
        by_sensor,
        basis,
        reduced.rigid_force,
        np.column_stack([np.ones(len(floors)), heights]),
    )
    projected = tuple(reduce_terms(reduced, own) for own in terms)
    below = found.frequency_hz < top_hz
    participation = (found.shapes[:, below].T @ structure.rigid_force[:, 0]) ** 2
    seen = SensorModel(
        model=by_sensor,
        channels=fine.channels,
        places=fine.places,
        frequency_hz=found.frequency_hz[below],
        effective_mass=participation / structure.rigid_mass[0, 0],
        direction="xy"[structure.direction],
        mesh_size=fine.mesh_size,
        dof=len(structure.axis),
    )
    return Truth(seen, EffectSystem(reduced, law, placed, projected), theta, values)


def _changed(
    structure: Structure,
    theta: Floats,
    terms: tuple[Terms, ...],
    values: tuple[float, ...],
    placed: tuple[Placed, ...],
) -> tuple[csc_matrix, csc_matrix, Floats]:
    """Stiffness and mass (n, n) and force (n, 2) at one theta with those of the effects."""
    stiffness, mass = structure.stiffness(theta), structure.mass
    force = structure.rigid_force
    first = 0
    for own, one in zip(terms, placed, strict=True):
        if not one.effect.parameters:
            continue
        size = values[first]
        first += len(one.effect.parameters)
        for story, matrix in own.stiffness:
            stiffness = stiffness + size * (1.0 if story == UNSCALED else theta[story]) * matrix
        if own.mass is not None:
            mass = mass + size * own.mass.matrix
            force = force + size * own.mass.force
    return csc_matrix(stiffness), csc_matrix(mass), force


def _orthonormal(structure: Structure, basis: Floats) -> Floats:
    """The shapes (n, r) made orthonormal in the mass of the unchanged structure."""
    for _ in range(2):  # shapes of the changed structure may be far from it
        energy, directions = np.linalg.eigh(basis.T @ (structure.mass @ basis))
        kept = energy > 1e-12 * energy[-1]
        basis = basis @ (directions[:, kept] / np.sqrt(energy[kept]))
    return basis
