"""A building with an effect put into its full model, seen by its accelerometers one by one.

The effect is put into the full equations of a finer mesh; the modes are those of the changed
structure, with the static shapes under every force that acts. Histories come from the complex
FRFs of every sensor at every frequency of the padded record, which is exact for a linear structure.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from femupdate.building.schema import Building, FrameBuilding
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import EffectSystem, ReducedStructure, reduce_terms
from femupdate.effects.effect import UNSCALED, Placed, Terms
from femupdate.effects.structure import Structure, structure_of
from femupdate.fe.assembly import AffineOperators, with_terms
from femupdate.fe.factorization import factorize
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.solve import modes_below
from femupdate.measurement.record import GroundMotion
from femupdate.workflow.full_model import SensorModel, SensorPoints, sensor_model, sensor_places

Floats = NDArray[np.float64]
# Silence behind the record, so that its end does not disturb its beginning: until the slowest
# motion has decayed to this share, within limits.
_REST, _SHORTEST_S, _LONGEST_S = 1e-5, 5.0, 600.0
_TERMS = 4  # of the power series, for every force
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

    def frf(self, frequency_hz: Floats, zeta: float) -> NDArray[np.complex128]:
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


def effect_truth(
    building: Building,
    theta: Floats,
    effects: tuple[tuple[Placed, tuple[float, ...]], ...],
    law: DampingLaw,
    top_hz: float,
    *,
    mesh_size: float | None = None,
    sensors: SensorPoints | None = None,
) -> Truth:
    """Put effects into the full model of a building.

    Args:
        building: of either kind.
        theta: (p,) stiffness factors.
        effects: each at its place, with all its parameters.
        law: of the damping.
        top_hz: all modes below it are kept; the others' response to every force is a power series.
        mesh_size: m; half of the building's own where None.
        sensors: as for `sensor_model`.

    Raises:
        BuildingError, ModelError: as `sensor_model`, or an effect cannot sit there.
    """
    placed = tuple(one for one, _ in effects)
    values = tuple(v for _, own in effects for v in own)
    if not isinstance(building, FrameBuilding):
        seen = sensor_model(building, theta, top_hz, mesh_size=mesh_size, sensors=sensors)
        structure = structure_of(building)
        reduced = structure_on(structure, np.diag(structure.points.mass**-0.5))
        terms = tuple(one.effect.terms(structure, one.place) for one in placed)
        projected = tuple(reduce_terms(reduced, own) for own in terms)
        return Truth(seen, EffectSystem(reduced, law, placed, projected), theta, values)
    sensed, size, channels, places = sensor_places(building, mesh_size, sensors)
    structure = structure_of(sensed, size)
    if structure.operators is None or structure.mesh is None:
        raise AssertionError("a frame has a mesh")
    terms = tuple(one.effect.terms(structure, one.place) for one in placed)
    changed = _changed(structure, theta, terms, values, placed)
    modes = modes_below(changed, np.zeros(0), top_hz)
    basis = _basis(structure, changed, modes.shapes, terms)
    reduced = structure_on(structure, basis)
    nodes = np.concatenate([structure.mesh.floor_nodes[floor] for floor in structure.mesh.floors])
    rows = structure.operators.expand(basis)[DOF_PER_NODE * nodes + structure.direction]
    floors = tuple(channel.floor for channel in channels)
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
    participation = (modes.shapes.T @ structure.rigid_force[:, 0]) ** 2
    seen = SensorModel(
        by_sensor,
        channels,
        places,
        modes.frequency_hz,
        participation / structure.rigid_mass[0, 0],
        building.sensors.direction,
        size,
        len(structure.axis),
    )
    return Truth(seen, EffectSystem(reduced, law, placed, projected), theta, values)


def _changed(
    structure: Structure,
    theta: Floats,
    terms: tuple[Terms, ...],
    values: tuple[float, ...],
    placed: tuple[Placed, ...],
) -> AffineOperators:
    """The operators at one theta with the stiffness and mass of the effects, no parameter left."""
    if structure.operators is None:
        raise AssertionError("a frame has operators")
    stiffness, mass = structure.stiffness(theta), structure.mass
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
    plain = replace(
        structure.operators,
        stiffness_constant=csc_matrix(stiffness),
        mass=csc_matrix(mass),
    )
    return with_terms(plain, ())


def _basis(
    structure: Structure, changed: AffineOperators, shapes: Floats, terms: tuple[Terms, ...]
) -> Floats:
    """Modes and static shapes (n, r), orthonormal in the mass of the unchanged structure.

    The static shapes are the first terms of the power series of what the modes leave out.
    """
    ports = [own.port.row for own in terms if own.port is not None]
    forces = np.column_stack([structure.rigid_force, *ports])
    factorization = factorize(changed.stiffness(np.zeros(0)))
    basis, series = shapes, forces
    for _ in range(_TERMS):
        image = changed.mass @ shapes
        series = factorization.solve(series - image @ (shapes.T @ series))
        basis = np.column_stack([basis, series])
        series = changed.mass @ series
    # Twice: modes and static shapes are nearly dependent.
    for _ in range(2):
        basis = basis / np.sqrt(np.einsum("ij,ij->j", basis, structure.mass @ basis))
        gram = basis.T @ (structure.mass @ basis)
        energy, directions = np.linalg.eigh(gram)
        kept = energy > 1e-12 * energy[-1]
        basis = basis @ (directions[:, kept] / np.sqrt(energy[kept]))
    return basis
