"""What is drawn: the building by nodes, shells and beams, and signs for what is in no mesh."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats, Integers
from femupdate.errors import ReportError
from femupdate.fe.model import FiniteElementModel

if TYPE_CHECKING:  # effects bring torch
    from femupdate.effects.effect import DrawnBuilding, Glyph

DEFORMATION = 0.12  # largest displacement as drawn, over the largest side of the building
VIEW = (-1.0, -1.55, 0.72)  # from the building towards the eye: at a corner, from above
MAGNITUDE_MAP, SPREAD_MAP = "viridis", "cividis"  # names of colour maps
FOLD = np.cos(np.radians(30.0))  # shells that meet at more than this angle make an edge


@dataclass(frozen=True)
class Geometry:
    """What is drawn of a finite-element model.

    Attributes:
        nodes: (N, 3) m, z up.
        shells: (n, 4) node indices.
        beams: (m, 2) node indices.
    """

    nodes: Floats
    shells: Integers
    beams: Integers

    @classmethod
    def of(cls, nodes: ArrayLike, shells: ArrayLike, beams: ArrayLike) -> "Geometry":
        """Take lists as well as arrays; either of shells and beams may be empty.

        Raises:
            ReportError: there is nothing to draw.
        """
        quads = np.asarray(shells, dtype=np.int64).reshape(-1, 4)
        lines = np.asarray(beams, dtype=np.int64).reshape(-1, 2)
        if not len(quads) and not len(lines):
            raise ReportError("there are neither shells nor beams to draw")
        return cls(np.asarray(nodes, dtype=np.float64), quads, lines)

    @classmethod
    def of_model(cls, model: FiniteElementModel) -> "Geometry":
        """The surfaces and lines of a finite-element model; a triangle repeats its last node."""
        return cls.of(model.nodes, model.faces, model.lines)

    @classmethod
    def of_building(cls, building: "DrawnBuilding") -> "Geometry":
        """Its mesh, or of a shear building columns and square slabs."""
        mesh = building.structure.mesh
        if mesh is not None:
            return cls.of_model(mesh.model)
        first = np.arange(0, len(building.nodes), 4)
        slabs = first[1:, None] + np.arange(4)
        columns = [np.column_stack([first[:-1] + k, first[1:] + k]) for k in range(4)]
        return cls.of(building.nodes, slabs, np.concatenate(columns))

    @property
    def size(self) -> float:
        """Largest side of the building, m."""
        used = np.unique(np.concatenate([self.shells.ravel(), self.beams.ravel()]))
        return float(np.ptp(self.nodes[used], axis=0).max())


def at_levels(floors: Sequence[tuple[str, float]], size: float) -> list[tuple[str, float]]:
    """Names and heights, m, of floors, those together that are nearer than a letter is high.

    Args:
        size: of the building, m.
    """
    levels: list[tuple[str, float]] = []
    for name, height in sorted(floors, key=lambda floor: floor[1]):
        if levels and height - levels[-1][1] < 0.035 * size:
            levels[-1] = (f"{levels[-1][0]}, {name}", levels[-1][1])
        else:
            levels.append((name, height))
    return levels


@dataclass(frozen=True)
class Landmarks:
    """What says where things are: names at places (k, 3), and axes (3, 2, 3) from end to tip."""

    names: tuple[str, ...]
    places: Floats
    axes: Floats

    @classmethod
    def of(
        cls, geometry: Geometry, floors: Sequence[tuple[str, float]], moved: float = 0.0
    ) -> "Landmarks":
        """Names of the floors (with their heights, m) left of them as seen, and the axes.

        Args:
            moved: how far the building moves as it is drawn, m, clear of the names.
        """
        low, high = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
        floors, gap = at_levels(floors, geometry.size), 0.05 * geometry.size
        left, back = low[0] - gap - moved, high[1] + gap + moved
        beside = [[left, back, low[2] + height] for _, height in floors]
        corner = np.array([high[0] + 3.5 * gap, low[1] - gap, low[2]])
        axes = np.stack([np.stack([corner, corner + 2.6 * gap * side]) for side in np.eye(3)])
        tips = corner + 3.4 * gap * np.eye(3)
        return cls((*(name for name, _ in floors), *"xyz"), np.array([*beside, *tips]), axes)


def deformed(geometry: Geometry, shape: Floats) -> Floats:
    """Return the nodes (N, 3) moved by a shape (N, 3), scaled so that it can be seen."""
    largest = np.linalg.norm(shape, axis=1).max()
    return geometry.nodes + shape * (DEFORMATION * geometry.size / (largest or 1.0))


def outline(geometry: Geometry) -> Integers:
    """Return lines (l, 2) that show the building without its mesh.

    These are the beams, and the sides of shells where a surface ends, folds or branches.
    """
    lines, owner, count = np.unique(
        _sides(geometry.shells), axis=0, return_inverse=True, return_counts=True
    )
    owner = owner.reshape(-1)
    corners = geometry.nodes[geometry.shells]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normals = np.repeat(normal / np.maximum(length, 1e-300), 4, axis=0)
    # Two shells on one side: compare their normals; the order of nodes may turn one about.
    order = np.argsort(owner, kind="stable")
    first = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int64)
    pair = count == 2
    a, b = normals[order[first[pair]]], normals[order[first[pair] + 1]]
    edge = ~pair
    edge[pair] = np.abs(np.einsum("ij,ij->i", a, b)) < FOLD
    return np.unique(np.concatenate([lines[edge], np.sort(geometry.beams, axis=1)]), axis=0)


def mesh_lines(geometry: Geometry) -> Integers:
    """Return the sides (l, 2) of all shells, each once."""
    return np.unique(_sides(geometry.shells), axis=0)


def _sides(shells: Integers) -> Integers:
    """Sides (4 n, 2) of the shells, the lower node first."""
    sides = np.stack([shells, np.roll(shells, -1, axis=1)], axis=-1)
    return np.sort(sides.reshape(-1, 2), axis=1)


_TURNS, _WIDTH = 5, 0.18  # of a spring; width over length


@dataclass(frozen=True)
class Glyphs:
    """What is drawn on top of a building, in its coordinates, m.

    Attributes:
        balls: centres (3,) and radii.
        lines: (n, 3) each, drawn as tubes.
        faces: (4, 3) each, drawn as surfaces.
    """

    balls: tuple[tuple[Floats, float], ...] = ()
    lines: tuple[Floats, ...] = field(default=())
    faces: tuple[Floats, ...] = ()

    def __add__(self, other: "Glyphs") -> "Glyphs":
        """Both."""
        return Glyphs(self.balls + other.balls, self.lines + other.lines, self.faces + other.faces)


def ball(centre: Floats, radius: float) -> Glyphs:
    """A mass."""
    return Glyphs(balls=((np.asarray(centre, dtype=np.float64), radius),))


def arrow(start: Floats, end: Floats) -> Glyphs:
    """From start to end, the head in the vertical plane or flat where the arrow is upright."""
    along = end - start
    length = float(np.linalg.norm(along))
    side = _across(along) * 0.14 * length
    neck = start + 0.72 * along
    return Glyphs(lines=(np.stack([start, end]), np.stack([neck + side, end, neck - side])))


def spring(start: Floats, end: Floats) -> Glyphs:
    """A zigzag between two points, straight at its ends."""
    along, side = end - start, _across(end - start)
    share = np.linspace(0.2, 0.8, 2 * _TURNS + 1)
    swing = _WIDTH * float(np.linalg.norm(along)) * np.where(np.arange(len(share)) % 2, 1.0, -1.0)
    swing[[0, -1]] = 0.0
    middle = start + share[:, None] * along + swing[:, None] * side
    return Glyphs(lines=(np.vstack([start, middle, end]),))


def dashpot(start: Floats, end: Floats) -> Glyphs:
    """A piston in a cup between two points."""
    along = end - start
    side = _across(along) * 0.09 * float(np.linalg.norm(along))
    cup = [start + 0.62 * along + side, start + 0.38 * along + side]
    cup += [start + 0.38 * along - side, start + 0.62 * along - side]
    plate = [start + 0.52 * along + 0.8 * side, start + 0.52 * along - 0.8 * side]
    rods = [[start, start + 0.38 * along], [start + 0.52 * along, end]]
    return Glyphs(lines=tuple(np.stack(points) for points in ([*cup], plate, *rods)))


def sensor(place: Floats, tip: Floats, radius: float) -> Glyphs:
    """A ball, and an arrow from it along the direction that is measured."""
    return ball(place, radius) + arrow(place, tip)


def _across(along: Floats) -> Floats:
    """A unit vector across a direction, upright unless that is upright itself."""
    unit = along / np.linalg.norm(along)
    up = np.array([0.0, 0.0, 1.0]) if abs(unit[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    side = up - (up @ unit) * unit
    return np.asarray(side / np.linalg.norm(side))


# Lines are points (n, 3) each, surfaces four corners (4, 3) each.
SIGNS: Mapping[str, Callable[..., Glyphs]] = {
    "ball": ball,
    "arrow": arrow,
    "spring": spring,
    "dashpot": dashpot,
    "lines": lambda paths: Glyphs(lines=tuple(paths)),
    "surfaces": lambda corners: Glyphs(faces=tuple(corners)),
    "sensor": sensor,
}


def drawn(glyphs: "Iterable[Glyph]") -> Glyphs:
    """Return the signs that an effect asks for.

    Raises:
        ReportError: one is of a kind that is not known.
    """
    found = Glyphs()
    for glyph in glyphs:
        if glyph.kind not in SIGNS:
            known = ", ".join(SIGNS)
            raise ReportError(f"no sign is named {glyph.kind!r} (known: {known}); write one")
        found += SIGNS[glyph.kind](*glyph.arguments)
    return found
