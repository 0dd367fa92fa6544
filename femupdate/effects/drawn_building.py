"""What effects need to know of a building as it is drawn, and the glyphs they ask for."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.effects.structure import Structure, numbers_of


@dataclass(frozen=True, eq=False)
class Glyph:
    """Something to be drawn on a building."""

    kind: str  # "ball", "arrow", "spring", "dashpot", "lines", "surfaces" or "sensor"
    # what the function of that name in `femupdate.report.geometry` takes; points m
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, kind: str, *arguments: Any) -> "Glyph":
        """A glyph of a kind, from what that kind takes."""
        return cls(kind, arguments)


@dataclass(frozen=True, eq=False)
class DrawnBuilding:
    """Corners and centres of a building as it is drawn."""

    structure: Structure  # the full model of the building

    @cached_property
    def nodes(self) -> Floats:
        """(N, 3) of the mesh, m; of a shear building the corners of a square plan at each level."""
        if self.structure.mesh is not None:
            return self.structure.mesh.model.nodes
        heights = np.concatenate([[0.0], self.structure.levels])
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5
        # The plan of a shear building is drawn this wide, of its height.
        plan = 0.45 * heights[-1] * corners
        return np.vstack([np.column_stack([plan, np.full(4, height)]) for height in heights])

    @cached_property
    def low(self) -> Floats:
        """(3,) least coordinates, m."""
        return np.asarray(self.nodes.min(axis=0))

    @cached_property
    def high(self) -> Floats:
        """(3,) greatest coordinates, m."""
        return np.asarray(self.nodes.max(axis=0))

    @cached_property
    def size(self) -> float:
        """Largest side of what is drawn, m; nodes without an element do not count."""
        used = self.nodes
        if self.structure.mesh is not None:
            model = self.structure.mesh.model
            used = used[np.unique(np.concatenate([model.faces.ravel(), model.lines.ravel()]))]
        return float(np.ptp(used, axis=0).max())

    @property
    def radius(self) -> float:
        """Of the ball of a sensor, m."""
        return 0.027 * self.size

    @cached_property
    def levels(self) -> Floats:
        """(f + 1,) heights of the base and the floors, m."""
        return np.asarray(self.low[2] + np.concatenate([[0.0], self.structure.levels]))

    def level(self, floor: str) -> int:
        """Index of a floor in `levels`."""
        return 1 + self.structure.floors.index(floor)

    def centre(self, level: int) -> Floats:
        """(3,) middle of a level, m; 0 is the base."""
        middle = 0.5 * (self.low + self.high)
        middle[2] = self.levels[level]
        return np.asarray(middle)

    def along(self, length: float) -> Floats:
        """(3,) a vector along the motion, m."""
        vector = np.zeros(3)
        vector[self.structure.direction] = length
        return vector

    def edges(self, level: int) -> tuple[Floats, Floats]:
        """The near corner of a level and the next one along the motion, (3,) each, m."""
        start = self.low.copy()
        start[2] = self.levels[level]
        depth = float((self.high - self.low)[self.structure.direction])
        return start, start + self.along(depth)

    def diagonal(self, lower: int, upper: int) -> tuple[Floats, Floats]:
        """From corner to corner between two levels, on the near face, (3,) each, m."""
        return self.edges(lower)[0], self.edges(upper)[1]

    def upright(self, axis: int, at: float, story: int) -> Floats:
        """(4, 3) corners of a story's face across an axis, m."""
        face = np.zeros((4, 3))
        face[:, axis] = at
        ends = self.low[1 - axis], self.high[1 - axis]
        face[:, 1 - axis] = [ends[0], ends[1], ends[1], ends[0]]
        bottom, top = self.low[2] + self.structure.feet[story], self.levels[story + 1]
        face[:, 2] = [bottom, bottom, top, top]
        return face

    def stories(self, place: str) -> list[int]:
        """Index of the stories that a place names, or those of all."""
        return numbers_of(place, self.structure.building.story_names)

    def sensors(self, place: str) -> tuple[Glyph, ...]:
        """The sensors of the floors that a place names, or those of all, along the motion."""
        floors, mesh = self.structure.floors, self.structure.mesh
        glyphs = []
        for floor in [part for part in place.split(",") if part in floors] or floors:
            points = self.centre(self.level(floor))[None]
            if mesh is not None:
                points = mesh.model.nodes[np.asarray(mesh.floor_nodes[floor])]
            arm = self.along(0.16 * self.size)
            glyphs += [Glyph.of("sensor", point, point + arm, self.radius) for point in points]
        return tuple(glyphs)

    def members(self, kinds: tuple[str, ...], place: str) -> tuple[Glyph, ...]:
        """The members of some kinds, in the story that a place names or in all."""
        if self.structure.mesh is None:
            return ()
        model, wanted = self.structure.mesh.model, self.stories(place)
        chosen = model.mapped(
            lambda part: part.taken(
                np.flatnonzero(np.isin(part.kind, kinds) & np.isin(part.group, wanted))
            )
        )
        lines, faces = model.nodes[chosen.lines], model.nodes[chosen.faces]
        return Glyph.of("lines", list(lines)), Glyph.of("surfaces", list(faces))
