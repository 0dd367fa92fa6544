"""The mesh lines of a frame building: every node lies where three of them cross."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.building.common import BASE
from femupdate.building.kinds import CLOSEST_LINES, FrameBuilding
from femupdate.building.references import Intersection, Stretch
from femupdate.errors import BuildingError

Index = Integers | int


@dataclass(frozen=True)
class Lines:
    """The mesh lines of one axis."""

    coordinate: Floats  # (n,) ascending, m
    at: Mapping[str, int]  # index of the mesh line on each named line (a grid line, or a floor)

    def __len__(self) -> int:
        return len(self.coordinate)

    def near(self, value: float) -> int:
        """Return the index of the mesh line at a coordinate that has one, m."""
        return int(np.abs(self.coordinate - value).argmin())

    def between(self, start: str, end: str) -> Integers:
        """Return the indices of the mesh lines from one named line to another, both included."""
        return np.arange(self.at[start], self.at[end] + 1)


def divisions(length: float, size: float) -> int:
    """Return into how many equal parts no longer than `size` a length is divided."""
    # 1.8 m in parts of 0.3 m is six parts, not seven.
    return max(1, math.ceil(length / size - 1e-6))


def divide(
    stations: Mapping[str, float], size: float, least: int = 1, extra: Sequence[float] = ()
) -> Lines:
    """Return the mesh lines through named coordinates, and through others without a name.

    Args:
        stations: coordinate of each named line, m.
        size: widest gap allowed, m.
        least: fewest parts of an interval between two of these lines.
        extra: further coordinates between the first and the last, m; one that lies on another
            line is that line.
    """
    values = np.unique(list(stations.values()))
    for value in sorted(extra):
        if np.abs(values - value).min() > CLOSEST_LINES:
            values = np.append(values, value)
    values.sort()
    parts = [max(least, divisions(b - a, size)) for a, b in pairwise(values.tolist())]
    pieces = [
        np.linspace(a, b, count, endpoint=False)
        for (a, b), count in zip(pairwise(values), parts, strict=True)
    ]
    index = np.concatenate([[0], np.cumsum(parts, dtype=np.int64)]).astype(np.int64)
    ordered = sorted(stations.items(), key=lambda item: item[1])
    at = {name: int(index[np.searchsorted(values, value)]) for name, value in ordered}
    return Lines(np.concatenate([*pieces, values[-1:]]), at)


@dataclass(frozen=True)
class ExtraLines:
    """Coordinates that need mesh lines beside those of grid lines and floors, m.

    They are the sides of openings, the places of columns off the grid, and the ends of the faces
    of beams that frame into a wall's edge.
    """

    x: tuple[float, ...] = ()
    y: tuple[float, ...] = ()
    z: tuple[float, ...] = ()

    def __add__(self, other: "ExtraLines") -> "ExtraLines":
        return ExtraLines(self.x + other.x, self.y + other.y, self.z + other.z)


@dataclass(frozen=True)
class Lattice:
    """The mesh lines of the three axes; a crossing's number rises with x, then y, then z."""

    x: Lines
    y: Lines
    z: Lines
    stories: tuple[tuple[str, str], ...]  # the levels below and above each story

    def crossings(self, ix: Index, iy: Index, iz: Index) -> Integers:
        """Return the numbers of the crossings of these mesh lines (broadcast)."""
        return np.asarray((iz * len(self.y) + iy) * len(self.x) + ix)

    def coordinates(self, crossing: Integers) -> Floats:
        """Return the (n, 3) coordinates of crossings, m."""
        rest, ix = np.divmod(crossing, len(self.x))
        iz, iy = np.divmod(rest, len(self.y))
        return np.stack([self.x.coordinate[ix], self.y.coordinate[iy], self.z.coordinate[iz]], 1)

    def level(self, crossing: Integers) -> Integers:
        """Return the index of the mesh line in z of each crossing."""
        return crossing // (len(self.x) * len(self.y))

    def story(self, number: int) -> Integers:
        """Return the mesh lines in z from the floor below a story to the one above it."""
        return self.z.between(*self.stories[number])

    def along(self, run: Stretch, levels: Integers) -> Integers:
        """Return the (points, levels) crossings of a stretch of a grid line at these levels."""
        if run.axis == 0:
            points, other = self.x.between(run.start, run.end), self.y.at[run.line]
            return self.crossings(points[:, None], other, levels[None, :])
        points, other = self.y.between(run.start, run.end), self.x.at[run.line]
        return self.crossings(other, points[:, None], levels[None, :])

    def upright(self, point: Intersection, levels: Integers) -> Integers:
        """Return the (levels,) crossings above an intersection of grid lines."""
        return self.crossings(self.x.at[point.x], self.y.at[point.y], levels)

    def rectangle(self, x: Sequence[str], y: Sequence[str], floor: str) -> Integers:
        """Return the (nx, ny) crossings between two lines of each family on a floor."""
        ix, iy = self.x.between(x[0], x[1]), self.y.between(y[0], y[1])
        return self.crossings(ix[:, None], iy[None, :], self.z.at[floor])


def lattice_of(
    building: FrameBuilding, size: float, least: int = 1, extra: ExtraLines = ExtraLines()
) -> Lattice:
    """Return the mesh lines of a building (size, least: see `divide`); level 0 is the base.

    Raises:
        BuildingError: the mesh size is so small that the mesh would not fit into memory.
    """
    grid, places = building.grid, (BASE, *building.floors)
    floors = dict(zip(places, [0.0, *building.floor_levels.tolist()], strict=True))
    stations, more = (grid.x, grid.y, floors), (extra.x, extra.y, extra.z)
    count = math.prod(
        sum(np.diff(sorted(station.values()))) / size + len(station) + len(cuts)
        for station, cuts in zip(stations, more, strict=True)
    )
    if count > 5_000_000:
        raise BuildingError(
            f"mesh.size: {size:g} m would give some {count:.1e} nodes; write a larger size"
        )
    x, y, z = (
        divide(station, size, least, cuts) for station, cuts in zip(stations, more, strict=True)
    )
    return Lattice(
        *(x, y, z),
        tuple((places[k + 1], floor) for k, floor in zip(building.below, places[1:], strict=True)),
    )


def strips(points: Integers) -> Integers:
    """Return the (n - 1, 2) line elements along (n,) crossings."""
    return np.stack([points[:-1], points[1:]], axis=1)


def quadrilaterals(points: Integers) -> Integers:
    """Return the (n, 4) elements of an (a, b) sheet of crossings, in order around each."""
    around = (points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:])
    return np.stack(around, axis=-1).reshape(-1, 4)
