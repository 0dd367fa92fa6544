"""A building's own equations at one theta, seen by its accelerometers one by one.

Nothing is shared with the model that inference uses: a frame is meshed finer, and hidden effects
are put into its full equations. What moves is followed by the shapes that the forces drive.
Histories come from the complex FRFs of every sensor at every frequency of the padded record, which
is exact for a linear structure.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.building.entry import ALL
from femupdate.building.kinds import FrameBuilding, MeshBuilding, ShearBuilding
from femupdate.building.mesh import mesh_building
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.equations import SensorRows, driven_system
from femupdate.dynamics.history import transformed_sensors
from femupdate.dynamics.reduced import lumped
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.effects.structure import Structure, structure_of
from femupdate.errors import BuildingError
from femupdate.fe.model import DOF_PER_NODE
from femupdate.measurement.names import FloorChannel, channel_name
from femupdate.measurement.record import GroundMotion

SensorPoints = Mapping[str, tuple[str, ...]] | tuple[str, ...]
Meshed = FrameBuilding | MeshBuilding


def sensor_places(
    building: Meshed, mesh_size: float | None, sensors: SensorPoints | None
) -> tuple[Meshed, float | None, tuple[FloorChannel, ...], tuple[str, ...]]:
    """The building with every sensor listed, its mesh size (m), the sensors and their places.

    The sensors come in the order of the nodes of the mesh's floors. A mesh that is read has no size
    and keeps its own sensors.

    Args:
        mesh_size: m; two fifths of the building's own where None.
        sensors: intersections of grid lines on every floor, or those of single floors by the
            floor's name. By default the building's own points, and where these are about the middle
            of the grid two opposite corners of it. For frames only.

    Raises:
        BuildingError: there is nothing at a point, no such floor, or a mesh that is read is given
            points or a size.
    """
    if isinstance(building, MeshBuilding):
        if sensors is not None or mesh_size is not None:
            raise BuildingError(
                f"{building.name}: the mesh and its sensors are those of {building.mesh.file}; "
                "leave mesh size and sensors out"
            )
        points = {floor: building.sensors.of(floor)[1] for floor in building.floors}
        update = {"sensors": building.sensors.model_copy(update={"floors": points})}
        building = building.model_copy(update=update)
    else:
        # Finer than the half of its own mesh on which calibrations work.
        mesh_size = 0.4 * building.mesh.size if mesh_size is None else mesh_size
        building = _sensed(building, sensors)
    direction = building.sensors.direction
    channels: list[FloorChannel] = []
    places: list[str] = []
    for floor in building.floors:
        at: tuple[Any, ...] = building.sensors.at.get(floor) or building.sensors.of(floor)[1]
        numbers = [""] if len(at) == 1 else [str(n) for n in range(1, len(at) + 1)]
        channels += [
            FloorChannel(channel_name(floor, n, direction), floor, n, direction) for n in numbers
        ]
        places += [p if isinstance(p, str) else f"({', '.join(f'{x:g}' for x in p)}) m" for p in at]
    return building, mesh_size, tuple(channels), tuple(places)


def _sensed(building: FrameBuilding, sensors: SensorPoints | None) -> FrameBuilding:
    """Return the building with the points of every floor listed one by one."""
    grid, sensing = building.grid, building.sensors
    everywhere = tuple(f"{y}-{x}" for y in grid.y for x in grid.x)

    def listed(points: tuple[str, ...]) -> tuple[str, ...]:
        """All points for "*", in the order in which the mesh takes it."""
        return everywhere if points == ALL else points

    def lines(point: str) -> frozenset[str]:
        """An intersection may be named in either order."""
        return frozenset(part.strip() for part in point.split("-"))

    wanted = {
        floor: listed(sensing.floors.get(floor) or sensing.points) for floor in building.floors
    }
    if sensors is None:
        x, y = (sorted(axis, key=axis.__getitem__) for axis in (grid.x, grid.y))
        corners = f"{y[0]}-{x[0]}", f"{y[-1]}-{x[-1]}"
        middle = 0.5 * np.array([grid.x[x[0]] + grid.x[x[-1]], grid.y[y[0]] + grid.y[y[-1]]])
        more = {}
        for floor, points in wanted.items():
            known = [lines(point) for point in points]
            places = [(grid.x[a], grid.y[b]) for a in x for b in y if {a, b} in known]
            # Where a floor turns, corners do not see what points elsewhere see in their mean.
            amid = bool(places) and np.allclose(np.mean(places, axis=0), middle)
            added = (corner for corner in corners if amid and lines(corner) not in known)
            more[floor] = (*points, *added)
        sensed = _with_points(building, more)
        try:
            mesh_building(sensed)
        except BuildingError:  # nothing is built at a corner
            return _with_points(building, wanted)
        return sensed
    if not isinstance(sensors, Mapping):
        sensors = dict.fromkeys(building.floors, sensors)
    for floor in sensors:
        if floor not in building.floors:
            raise BuildingError(
                f"sensors of {floor!r}: the building {building.name} has no such floor; its floors "
                f"are {', '.join(building.floors)}"
            )
    asked = {floor: listed(tuple(points)) for floor, points in sensors.items()}
    return _with_points(building, {**wanted, **asked}, asked)


def _with_points(
    building: FrameBuilding, points: Mapping[str, tuple[str, ...]], asked: Iterable[str] = ()
) -> FrameBuilding:
    empty = [floor for floor, places in points.items() if not places]
    if empty:
        raise BuildingError(f"sensors of {empty[0]!r}: no point is named; name one at least")
    kept = {floor: at for floor, at in building.sensors.at.items() if floor not in asked}
    sensors = building.sensors.model_copy(update={"floors": dict(points), "at": kept})
    return building.model_copy(update={"sensors": sensors})


@dataclass(frozen=True, eq=False)
class FineModel:
    """What of a truth depends on neither theta nor the effects: a building's own equations."""

    building: Building  # with every sensor listed
    structure: Structure  # the full model; a frame is meshed finer than for the updating
    channels: tuple[FloorChannel, ...]  # (c,) the sensors, floor by floor
    places: tuple[str, ...]  # (c,) where each one is
    mesh_size: float | None  # m; None for a shear building

    @property
    def direction(self) -> str:
        """Of the motion, "x" or "y"."""
        return "xy"[self.structure.direction]

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return len(self.structure.axis)


@dataclass(frozen=True, eq=False)
class Truth:
    """A building at one theta, with the effects that are put into it."""

    fine: FineModel  # its sensors and mesh
    system: System  # its response, a row for every sensor
    theta: Floats  # (p,) stiffness factors; none where they are in the system already
    values: tuple[float, ...]  # parameters of the effects
    # (m,) of the shapes that it is followed by, Hz; a natural frequency where one has converged
    frequency_hz: Floats
    effective_mass: Floats  # (m,) share of the mass that each moves in the direction of the motion

    def respond(self, zeta: float, motion: GroundMotion) -> Floats:
        """Absolute accelerations (c, n), m/s2, under a base motion."""
        sample = (
            torch.from_numpy(self.theta)[None],
            torch.tensor([zeta], dtype=torch.float64),
            torch.tensor([self.values], dtype=torch.float64).reshape(1, -1),
        )
        # The motion has decayed to this share behind the record.
        return transformed_sensors(self.system, sample, motion.inputs, motion.time_step, 1e-5)


def fine_model(
    building: Building, mesh_size: float | None = None, sensors: SensorPoints | None = None
) -> FineModel:
    """Mesh and assemble a building; a shear building is taken as it is.

    Raises:
        BuildingError, StructureError: as `sensor_places`, or a shear building is given either.
    """
    if isinstance(building, ShearBuilding):
        if sensors is not None or mesh_size is not None:
            raise BuildingError(
                f"{building.name}: a shear building has neither a mesh nor sensor points; leave "
                "both out"
            )
        channels = tuple(FloorChannel(floor, floor) for floor in building.floors)
        places = ("",) * len(channels)
        return FineModel(building, structure_of(building), channels, places, None)
    sensed, size, channels, places = sensor_places(building, mesh_size, sensors)
    halved = isinstance(sensed, MeshBuilding)
    return FineModel(sensed, structure_of(sensed, size, halved=halved), channels, places, size)


def truth_of(
    fine: FineModel,
    theta: Floats,
    law: DampingLaw,
    top_hz: float,
    effects: tuple[tuple[Placed, tuple[float, ...]], ...] = (),
    columns: int = 1,
) -> Truth:
    """The full model of a building at one theta.

    Args:
        top_hz: up to where the response to every force must be right.
        effects: put into the model, each at its place, with all its parameters.
        columns: of the base's motion that are driven (see `Excitation`).

    Raises:
        StructureError: the structure is a mechanism, or theta does not fit.
    """
    structure, placed = fine.structure, tuple(listed for listed, _ in effects)
    values = tuple(v for _, sizes in effects for v in sizes)
    if structure.is_stick:
        reduced = lumped(structure)
        system = System(
            reduced.model, law, placed, tuple(reduced.terms(listed) for listed in placed)
        )
        squared, vectors = np.linalg.eigh(reduced.model.stiffness(theta))
        share = (vectors.T @ reduced.model.excitation) ** 2
        frequency = np.sqrt(np.maximum(squared, 0.0)) / (2.0 * np.pi)
        return Truth(fine, system, theta, values, frequency, share / share.sum())
    mesh, operators = structure.meshed
    nodes = np.concatenate([mesh.floor_nodes[floor] for floor in mesh.floors])
    rows = np.zeros((len(nodes), operators.dof))
    rows[np.arange(len(nodes)), DOF_PER_NODE * nodes + structure.direction] = 1.0
    floors = tuple(channel.floor for channel in fine.channels)
    heights = np.array([structure.levels[structure.floors.index(floor)] for floor in floors])
    found = driven_system(
        structure,
        [(listed, listed.effect.terms(structure, listed.place)) for listed in placed],
        theta,
        np.array(values),
        top_hz,
        law,
        SensorRows(floors, operators.gather(rows.T).T, heights),
        columns,
    )
    below = found.frequency_hz < top_hz
    participation = (found.shapes[:, below].T @ structure.rigid_force[:, 0]) ** 2
    share = participation / structure.rigid_mass[0, 0]
    return Truth(fine, found.system, np.zeros(0), values, found.frequency_hz[below], share)
