"""A building's own equations at one theta, seen by its accelerometers one by one.

Nothing is shared with the reduction that inference uses: a frame is meshed finer and solved with
all its modes up to a frequency, the stiffer ones standing in as one static shape.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.frame import FrameBuilding
from femupdate.building.mesh import mesh_building
from femupdate.building.own_mesh import MeshBuilding
from femupdate.building.quantities import ALL
from femupdate.building.schema import Building
from femupdate.building.shear import ShearBuilding, shear_operators
from femupdate.dynamics.projection import reduce_lumped
from femupdate.dynamics.reduced import ReducedModel
from femupdate.errors import BuildingError
from femupdate.fe.assembly import AffineOperators, assemble
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.solve import Modes, modes_below, static_displacement
from femupdate.measurement.columns import Channel, channel_name

SensorPoints = Mapping[str, tuple[str, ...]] | tuple[str, ...]

# Of the building's own mesh: finer than the half on which calibrations work.
_FINER = 0.4
_NOTHING_LEFT = 1e-20  # of the static shape's energy: all modes are there


@dataclass(frozen=True, kw_only=True)
class SensorModel:
    """A building at one theta as a model without parameters, with a row for every sensor.

    Attributes:
        model: coordinates are modes and, last, the static shape; `floors` are the channels' names.
        channels: (c,) the sensors, floor by floor.
        places: (c,) where each one is, such as "X1-Y2"; empty in a shear building.
        frequency_hz: (m,) natural frequencies of the modes, Hz.
        effective_mass: (m,) share of the mass that each moves in the direction of the motion.
        direction: of the motion, "x" or "y".
        mesh_size: m; None for a shear building and for a mesh that was read.
        dof: degrees of freedom of the full model.
    """

    model: ReducedModel
    channels: tuple[Channel, ...]
    places: tuple[str, ...]
    frequency_hz: Floats
    effective_mass: Floats
    direction: str
    mesh_size: float | None
    dof: int


def sensor_model(
    building: Building,
    theta: Floats,
    top_hz: float,
    *,
    mesh_size: float | None = None,
    sensors: SensorPoints | None = None,
) -> SensorModel:
    """Return the full model of a building at one theta, seen by its sensors.

    Args:
        building: of either kind; a shear building is taken as it is.
        theta: (p,) stiffness factors.
        top_hz: all modes below this are kept; stiffer ones respond as if static.
        mesh_size: m; two fifths of the building's own where None.
        sensors: intersections of grid lines on every floor, or those of single floors by the
            floor's name. By default the building's own points and two opposite corners of the
            grid, which leave the middle of the floor where it is. For frames only.

    Raises:
        BuildingError: there is nothing at a point, no such floor, or a shear building is given
            points or a mesh size.
        ModelError: the structure is a mechanism, or theta does not fit.
    """
    if isinstance(building, ShearBuilding):
        if sensors is not None or mesh_size is not None:
            raise BuildingError(
                f"{building.name}: a shear building has neither a mesh nor sensor points; leave "
                "both out"
            )
        return _shear_model(building, theta)
    sensed, size, _, _ = sensor_places(building, mesh_size, sensors)
    return _frame_model(sensed, mesh_building(sensed, size), theta, top_hz, size)


Meshed = FrameBuilding | MeshBuilding


def sensor_places(
    building: Meshed, mesh_size: float | None, sensors: SensorPoints | None
) -> tuple[Meshed, float | None, tuple[Channel, ...], tuple[str, ...]]:
    """The building with every sensor listed, its mesh size (m), the sensors and their places.

    The sensors come in the order of the nodes of the mesh's floors. A mesh that is read has no size
    and keeps its own sensors. Arguments and errors are those of `sensor_model`.
    """
    if isinstance(building, MeshBuilding):
        if sensors is not None or mesh_size is not None:
            raise BuildingError(
                f"{building.name}: the mesh and its sensors are those of {building.mesh.file}; "
                "leave mesh size and sensors out"
            )
        own = {floor: building.sensors.of(floor)[1] for floor in building.floors}
        update = {"sensors": building.sensors.model_copy(update={"floors": own})}
        building = building.model_copy(update=update)
        return building, None, *_channels(building)
    size = _FINER * building.mesh.size if mesh_size is None else mesh_size
    sensed = _sensed(building, sensors)
    return sensed, size, *_channels(sensed)


def _shear_model(building: ShearBuilding, theta: Floats) -> SensorModel:
    lumped = shear_operators(building)
    model = reduce_lumped(lumped.stiffness_terms, lumped.mass, lumped.floors)
    squared, vectors = np.linalg.eigh(model.stiffness(theta))
    modal_mass = (vectors.T @ model.excitation) ** 2
    return SensorModel(
        model=_at_theta(model, theta),
        channels=tuple(Channel(floor, floor) for floor in building.floors),
        places=("",) * len(building.floors),
        frequency_hz=np.sqrt(np.maximum(squared, 0.0)) / (2.0 * np.pi),
        effective_mass=modal_mass / modal_mass.sum(),
        direction="x",
        mesh_size=None,
        dof=len(building.floors),
    )


def _at_theta(model: ReducedModel, theta: Floats) -> ReducedModel:
    size = model.size
    return replace(
        model, stiffness_terms=np.zeros((0, size, size)), stiffness_constant=model.stiffness(theta)
    )


def _frame_model(
    building: Meshed, mesh: BuildingMesh, theta: Floats, top_hz: float, size: float | None
) -> SensorModel:
    operators = assemble(mesh.model)
    modes = modes_below(operators, theta, top_hz)
    basis, stiffness = _with_static_shape(operators, theta, modes, mesh.direction)
    excitation = operators.inertia(mesh.direction)
    everything = operators.rigid_translation(mesh.direction)
    channels, places = _channels(building)
    nodes = np.concatenate([mesh.floor_nodes[floor] for floor in mesh.floors])
    rows = operators.expand(basis)[DOF_PER_NODE * nodes + mesh.direction]
    return SensorModel(
        model=_model(stiffness, basis.T @ excitation, rows, channels),
        channels=channels,
        places=places,
        frequency_hz=modes.frequency_hz,
        effective_mass=(modes.shapes.T @ excitation) ** 2
        / (everything @ (operators.mass_full @ everything)),
        direction=building.sensors.direction,
        mesh_size=size,
        dof=len(operators.free),
    )


def _with_static_shape(
    operators: AffineOperators, theta: Floats, modes: Modes, direction: int
) -> tuple[Floats, Floats]:
    """Mass-orthonormal basis (n_free, r) and its diagonal stiffness (r,), 1/s2.

    The last shape is what the modes miss of the static response to the base motion (the mode
    acceleration method; Cornwell, Craig and Johnson, 1983), so that the response at low
    frequency is exact and that in between errs as the square of frequency over `top_hz`.
    """
    load = operators.expand(operators.inertia(direction))
    static = operators.restrict(static_displacement(operators, theta, load))
    rest = static - modes.shapes @ (modes.shapes.T @ (operators.mass @ static))
    rest -= modes.shapes @ (modes.shapes.T @ (operators.mass @ rest))  # round-off of the first
    squared = (2.0 * np.pi * modes.frequency_hz) ** 2
    energy = float(rest @ (operators.mass @ rest))
    if energy <= _NOTHING_LEFT * float(static @ (operators.mass @ static)):
        return modes.shapes, squared
    rest /= np.sqrt(energy)
    own = float(rest @ (operators.stiffness(theta) @ rest))
    return np.column_stack([modes.shapes, rest]), np.append(squared, own)


def _model(
    stiffness: Floats, excitation: Floats, rows: Floats, channels: tuple[Channel, ...]
) -> ReducedModel:
    """A model that knows its sensors and no stories."""
    size = len(stiffness)
    return ReducedModel(
        stiffness_terms=np.zeros((0, size, size)),
        stiffness_constant=np.diag(stiffness),
        excitation=excitation,
        floor_shapes=rows,
        floors=tuple(channel.name for channel in channels),
        story_inertia=np.zeros((0, size)),
        story_mass=np.zeros(0),
        story_drift=np.zeros((0, size)),
    )


def _channels(building: Meshed) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """The sensors and their places, in the order of the mesh's floor nodes."""
    direction = building.sensors.direction
    channels: list[Channel] = []
    places: list[str] = []
    for floor, points in building.sensors.floors.items():
        numbers = [""] if len(points) == 1 else [str(n) for n in range(1, len(points) + 1)]
        channels += [
            Channel(channel_name(floor, n, direction), floor, n, direction) for n in numbers
        ]
        places += [p if isinstance(p, str) else f"({p[0]:g}, {p[1]:g}) m" for p in points]
    return tuple(channels), tuple(places)


def _sensed(building: FrameBuilding, sensors: SensorPoints | None) -> FrameBuilding:
    """Return the building with the points of every floor listed one by one."""
    own = {floor: _own_points(building, floor) for floor in building.floors}
    if sensors is None:
        with_corners = {floor: _add(points, _corners(building)) for floor, points in own.items()}
        return _try_points(building, with_corners) or _with_points(building, own)
    if not isinstance(sensors, Mapping):
        sensors = dict.fromkeys(building.floors, sensors)
    for floor in sensors:
        if floor not in building.floors:
            raise BuildingError(
                f"sensors of {floor!r}: the building {building.name} has no such floor; its floors "
                f"are {', '.join(building.floors)}"
            )
    asked = {floor: _listed(building, tuple(points)) for floor, points in sensors.items()}
    return _with_points(building, {**own, **asked})


def _own_points(building: FrameBuilding, floor: str) -> tuple[str, ...]:
    return _listed(building, building.sensors.floors.get(floor) or building.sensors.points)


def _listed(building: FrameBuilding, points: tuple[str, ...]) -> tuple[str, ...]:
    """Spell out "*", in the order in which the mesh takes it."""
    if points != ALL:
        return points
    return tuple(f"{y}-{x}" for y in building.grid.y for x in building.grid.x)


def _corners(building: FrameBuilding) -> tuple[str, ...]:
    x, y = (sorted(lines, key=lines.__getitem__) for lines in (building.grid.x, building.grid.y))
    return f"{y[0]}-{x[0]}", f"{y[-1]}-{x[-1]}"


def _add(points: tuple[str, ...], more: tuple[str, ...]) -> tuple[str, ...]:
    """Add the points that are not there yet; an intersection may be named in either order."""
    there = [_lines(point) for point in points]
    return (*points, *(point for point in more if _lines(point) not in there))


def _lines(point: str) -> frozenset[str]:
    return frozenset(part.strip() for part in point.split("-"))


def _with_points(building: FrameBuilding, points: Mapping[str, tuple[str, ...]]) -> FrameBuilding:
    empty = [floor for floor, own in points.items() if not own]
    if empty:
        raise BuildingError(f"sensors of {empty[0]!r}: no point is named; name one at least")
    sensors = building.sensors.model_copy(update={"floors": dict(points)})
    return building.model_copy(update={"sensors": sensors})


def _try_points(
    building: FrameBuilding, points: Mapping[str, tuple[str, ...]]
) -> FrameBuilding | None:
    """Return the building with these points, or None where nothing is built at one of them."""
    sensed = _with_points(building, points)
    try:
        mesh_building(sensed)
    except BuildingError:
        return None
    return sensed
