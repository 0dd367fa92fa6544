"""Where the effects of the catalogue sit in a building, as signs to be drawn on it."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.frame import FrameBuilding
from femupdate.effects.effect import Placed
from femupdate.effects.infill import infill_lines
from femupdate.effects.member import ALL, MemberStiffness
from femupdate.effects.structure import Structure
from femupdate.report.geometry import Geometry
from femupdate.report.glyphs import Glyphs, arrow, ball, dashpot, spring, surfaces

_PLAN = 0.45  # side of the plan of a shear building as drawn, over its height
_SENSOR = 0.018  # radius over the building's size
_HALF = 0.5


def geometry_of(structure: Structure) -> Geometry:
    """What is drawn of a building: its mesh, or of a shear building columns and square slabs."""
    if structure.mesh is not None:
        return Geometry.of_model(structure.mesh.model)
    heights = np.concatenate([[0.0], structure.levels])
    side = _PLAN * heights[-1]
    plan = side * (np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5)
    nodes = np.vstack([np.column_stack([plan, np.full(4, z)]) for z in heights])
    first = 4 * np.arange(len(heights))
    slabs = first[1:, None] + np.arange(4)
    columns = np.concatenate([np.column_stack([first[:-1] + k, first[1:] + k]) for k in range(4)])
    return Geometry.of(nodes, slabs, columns)


def effect_glyphs(structure: Structure, geometry: Geometry, placed: Placed) -> Glyphs:
    """Signs for an effect at its place; arrows at all sensors for what is everywhere."""
    drawn = _Building(structure, geometry)
    name, place = placed.effect.name, placed.place
    if isinstance(placed.effect, MemberStiffness):
        return drawn.members(placed.effect.kinds, place)
    if name == "flexible_diaphragm":
        return drawn.members(("slab",), place)
    if name == "non_structural_walls":
        return drawn.infill(place)
    if placed.effect.needs_levels:
        return drawn.stories(place)
    if name in _SIGNS:
        return _SIGNS[name](drawn, place)
    # Instruments: a ball at every sensor that the place names, all of them for "floors".
    named = [part for part in place.split(",") if part in structure.floors]
    if place == "base":
        return ball(drawn.low(), drawn.radius)
    return drawn.sensors(named or list(structure.floors))


class _Building:
    """A building's corners and centres as it is drawn."""

    def __init__(self, structure: Structure, geometry: Geometry) -> None:
        self.structure, self.size = structure, geometry.size
        self.corner, self.far = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
        self.levels = self.corner[2] + np.concatenate([[0.0], structure.levels])
        self.radius = 1.5 * _SENSOR * geometry.size

    def floor(self, name: str) -> Floats:
        """Centre of a floor."""
        middle = _HALF * (self.corner + self.far)
        middle[2] = self.levels[1 + self.structure.floors.index(name)]
        return middle

    def low(self) -> Floats:
        """Centre of the base."""
        middle = _HALF * (self.corner + self.far)
        middle[2] = self.levels[0]
        return middle

    def along(self, length: float) -> Floats:
        """A vector along the motion."""
        vector = np.zeros(3)
        vector[self.structure.direction] = length
        return vector

    def mass(self, place: str) -> Glyphs:
        """A ball on a floor."""
        radius = 0.055 * self.size
        return ball(self.floor(place) + np.array([0.0, 0.0, radius]), radius)

    def appendage(self, place: str) -> Glyphs:
        """A ball on a spring on a floor."""
        foot = self.floor(place)
        head = foot + np.array([0.0, 0.0, 0.16 * self.size])
        return spring(foot, head) + ball(head, 0.04 * self.size)

    def damper(self, place: str) -> Glyphs:
        """A dashpot from corner to corner of a story, on the near face."""
        story = self.structure.floors.index(place)
        start, end = self.corner.copy(), self.corner.copy()
        end[self.structure.direction] = self.far[self.structure.direction]
        start[2], end[2] = self.levels[story], self.levels[story + 1]
        return dashpot(start, end)

    def sway(self, _: str) -> Glyphs:
        """A spring beside the base, along the motion."""
        start = self.corner.copy()
        start[2] = self.levels[0]
        return spring(start - self.along(0.25 * self.size), start)

    def rocking(self, _: str) -> Glyphs:
        """Upright springs under two opposite edges of the base."""
        down = np.array([0.0, 0.0, -0.13 * self.size])
        left = self.corner.copy()
        left[2] = self.levels[0]
        right = left + self.along(float((self.far - self.corner)[self.structure.direction]))
        return spring(left + down, left) + spring(right + down, right)

    def pitch(self, _: str) -> Glyphs:
        """A tilted line under the base with arrows down and up at its ends."""
        left = self.corner.copy()
        left[2] = self.levels[0] - 0.05 * self.size
        right = left + self.along(float((self.far - self.corner)[self.structure.direction]))
        rise = np.array([0.0, 0.0, 0.09 * self.size])
        tilted = Glyphs(lines=(np.stack([left - 0.4 * rise, right + 0.4 * rise]),))
        return tilted + arrow(left, left - rise) + arrow(right - rise, right + 0.8 * rise)

    def eccentric(self, _: str) -> Glyphs:
        """Balls beside the middle of every floor."""
        aside = np.zeros(3)
        across = 1 - self.structure.direction
        aside[across] = 0.15 * (self.far - self.corner)[across]
        signs = Glyphs()
        for name in self.structure.floors:
            middle = self.floor(name)
            signs = signs + arrow(middle, middle + aside) + ball(middle + aside, self.radius)
        return signs

    def damping(self, _: str) -> Glyphs:
        """A dashpot in every story."""
        signs = Glyphs()
        for name in self.structure.floors:
            signs = signs + self.damper(name)
        return signs

    def sensors(self, floors: list[str]) -> Glyphs:
        """A ball at every sensor of some floors, and an arrow along the motion."""
        signs, mesh = Glyphs(), self.structure.mesh
        for name in floors:
            places = self.floor(name)[None]
            if mesh is not None:
                places = mesh.model.nodes[np.asarray(mesh.floor_nodes[name])]
            for place in places:
                tip = place + self.along(0.16 * self.size)
                signs = signs + ball(place, self.radius) + arrow(place, tip)
        return signs

    def members(self, kinds: tuple[str, ...], place: str) -> Glyphs:
        """The members themselves."""
        if self.structure.mesh is None:
            return Glyphs()
        model, names = self.structure.mesh.model, self.structure.building.story_names
        wanted = list(range(len(names))) if place == ALL else [names.index(place)]
        chosen = model.mapped(
            lambda part: part.taken(
                np.flatnonzero(np.isin(part.kind, kinds) & np.isin(part.group, wanted))
            )
        )
        return Glyphs(
            lines=tuple(model.nodes[chosen.lines]), faces=tuple(model.nodes[chosen.faces])
        )

    def stories(self, place: str) -> Glyphs:
        """The near faces of a story, or of all."""
        names = self.structure.building.story_names
        wanted = range(len(names)) if place == ALL else [names.index(place)]
        faces = [(0, self.corner[0]), (1, self.corner[1])]
        return surfaces([self._upright(axis, at, k) for k in wanted for axis, at in faces])

    def infill(self, place: str) -> Glyphs:
        """Walls that the mesh does not have, from line to line of the grid."""
        building, names = self.structure.building, self.structure.building.story_names
        if not isinstance(building, FrameBuilding):
            return Glyphs()
        line, _, story = place.partition("/")
        corners = []
        for own, stories in infill_lines(building).items():
            axis = 1 if own in building.grid.y else 0
            at = building.grid.y[own] if axis else building.grid.x[own]
            for k in stories:
                if line in (ALL, own) and story in ("", names[k]):
                    corners.append(self._upright(axis, float(at), k))
        return surfaces(corners)

    def _upright(self, axis: int, at: float, story: int) -> Floats:
        face = np.zeros((4, 3))
        face[:, axis] = at
        ends = self.corner[1 - axis], self.far[1 - axis]
        face[:, 1 - axis] = [ends[0], ends[1], ends[1], ends[0]]
        low, high = self.levels[story], self.levels[story + 1]
        face[:, 2] = [low, low, high, high]
        return face


_SIGNS = {
    "added_mass": _Building.mass,
    "tuned_appendage": _Building.appendage,
    "story_damper": _Building.damper,
    "base_sway": _Building.sway,
    "foundation_rocking": _Building.rocking,
    "table_pitch": _Building.pitch,
    "eccentricity": _Building.eccentric,
    "damping_law": _Building.damping,
}
