"""The building as it is drawn: nodes, shells, beams, and the lines that show its outline."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats, Integers
from femupdate.effects.drawn_building import DrawnBuilding
from femupdate.errors import ReportError
from femupdate.fe.model import FiniteElementModel

DEFORMATION = 0.12  # largest displacement as drawn, over the largest side of the building
VIEW = (-1.0, -1.55, 0.72)  # from the building towards the eye: at a corner, from above
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
    def of_building(cls, building: DrawnBuilding) -> "Geometry":
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
        return float(np.ptp(self._drawn(), axis=0).max())

    def _drawn(self) -> Floats:
        used = np.unique(np.concatenate([self.shells.ravel(), self.beams.ravel()]))
        return self.nodes[used]


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

    names: tuple[str, ...] = ()
    places: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    axes: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))

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
