"""Where the accelerometers of a simulation are: single ones, at points of the mesh."""

from collections.abc import Mapping

from femupdate.building.frame import FrameBuilding
from femupdate.building.mesh import mesh_building
from femupdate.building.own_mesh import MeshBuilding
from femupdate.building.quantities import ALL
from femupdate.errors import BuildingError
from femupdate.measurement.columns import Channel, channel_name

SensorPoints = Mapping[str, tuple[str, ...]] | tuple[str, ...]
Meshed = FrameBuilding | MeshBuilding

# Of the building's own mesh: finer than the half on which calibrations work.
_FINER = 0.4


def sensor_places(
    building: Meshed, mesh_size: float | None, sensors: SensorPoints | None
) -> tuple[Meshed, float | None, tuple[Channel, ...], tuple[str, ...]]:
    """The building with every sensor listed, its mesh size (m), the sensors and their places.

    The sensors come in the order of the nodes of the mesh's floors. A mesh that is read has no size
    and keeps its own sensors.

    Args:
        mesh_size: m; two fifths of the building's own where None.
        sensors: intersections of grid lines on every floor, or those of single floors by the
            floor's name. By default the building's own points and two opposite corners of the
            grid, which leave the middle of the floor where it is. For frames only.

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
        own = {floor: building.sensors.of(floor)[1] for floor in building.floors}
        update = {"sensors": building.sensors.model_copy(update={"floors": own})}
        building = building.model_copy(update=update)
        return building, None, *_channels(building)
    size = _FINER * building.mesh.size if mesh_size is None else mesh_size
    sensed = _sensed(building, sensors)
    return sensed, size, *_channels(sensed)


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
    own = {
        floor: _listed(building, building.sensors.floors.get(floor) or building.sensors.points)
        for floor in building.floors
    }
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
