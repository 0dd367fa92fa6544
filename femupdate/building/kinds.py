"""Buildings of three kinds, as their files have them: frames on grid lines, sticks, own meshes."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from femupdate.arrays import Floats, Integers
from femupdate.building.common import Building, MeshedBuilding
from femupdate.building.entry import (
    ALL,
    Complaint,
    Complaints,
    Coordinate,
    Entry,
    Flag,
    Label,
    Length,
    LengthOrZero,
    Mass,
    Names,
    Number,
    Stiffness,
    StiffnessPerMass,
    Stress,
)
from femupdate.building.members import (
    RELEASED,
    BeamLines,
    Braces,
    ColumnGroup,
    Grid,
    InfillWall,
    Material,
    Mesh,
    Opening,
    Sensors,
    SensorsAnywhere,
    Slab,
    Story,
    Wall,
)
from femupdate.building.mesh_check import LEVEL
from femupdate.building.references import (
    beam_stretches,
    intersections,
    require,
    resolve,
    slab_lines,
    spans,
    wall_stretch,
)
from femupdate.building.shipped import program_of
from femupdate.errors import BuildingError


def _each_line(members: object) -> object:
    """Braces, infills or walls with a list of lines, as one entry for each line."""
    if not isinstance(members, list):
        return members
    return [
        {**member, "along": line} if isinstance(line, str) else member
        for member in members
        for along in (member.get("along") if isinstance(member, dict) else None,)
        for line in (along if isinstance(along, list) and along else [along])
    ]


CLOSEST_LINES = 1e-3  # m; nearer lines would make needle-thin elements


class FrameBuilding(MeshedBuilding):
    """A building of columns, beams, walls and slabs on a grid of named lines."""

    kind: Literal["frame"]
    grid: Grid
    columns: tuple[ColumnGroup, ...] = ()
    beams: tuple[BeamLines, ...] = ()
    braces: Annotated[tuple[Braces, ...], BeforeValidator(_each_line)] = ()
    walls: Annotated[tuple[Wall, ...], BeforeValidator(_each_line)] = ()
    infills: Annotated[tuple[InfillWall, ...], BeforeValidator(_each_line)] = ()
    slabs: tuple[Slab, ...] = ()
    mesh: Mesh
    sensors: Sensors

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        super().check()
        for number, entry in enumerate(self.stories):
            if entry.x is not None or entry.y is not None:
                key = f"stories[{number}].{'y' if entry.x is None else 'x'}"
                raise Complaint(key, "members of a frame name their story; remove it")
        _check_lines(self.grid.x, "grid.x")
        _check_lines(self.grid.y, "grid.y")
        for name in self.grid.x:
            if name in self.grid.y:
                raise Complaint(f"grid.x.{name}", "a line of grid.y has the same name; rename one")
        _check_members(self)
        _check_columns(self)
        _check_stretches(self)
        intersections(self.grid, self.sensors.points, "sensors.points")
        for floor in self.sensors.floors:
            key, points = self.sensors.of(floor)
            intersections(self.grid, points, key)
        for n, group in enumerate(self.springs):
            intersections(self.grid, group.at, f"springs[{n}].at")
        named = [columns.stories for columns in self.columns]
        named += [wall.stories for wall in self.walls if wall.is_stiff]
        stories = self.story_names
        held = {story for names in named for story in resolve(names, stories, "story", "stories")}
        for number, story in enumerate(stories):
            if story not in held:
                text = f"no column or wall with stiffness stands in story {story!r}; add one"
                raise Complaint(f"stories[{number}]", text)


def _check_lines(lines: Mapping[str, float], key: str) -> None:
    if not lines:
        raise Complaint(key, 'it has no line; add one, such as A = "0 m"')
    ordered = sorted(lines.items(), key=lambda item: item[1])
    for (first, low), (second, high) in pairwise(ordered):
        if high - low < CLOSEST_LINES:
            raise Complaint(f"{key}.{second}", f"it lies on {first!r}; move one or remove it")
    for name in lines:
        if "-" in name or name == "*" or not name.strip():
            raise Complaint(f"{key}.{name}", 'a line\'s name has no "-" and is not "*"; rename it')


def _check_members(building: FrameBuilding) -> None:
    """What members of all kinds name: stories or floors, and a section or a material."""
    lists = {name: getattr(building, name) for name in ("columns", "beams", "braces")}
    surfaces = {name: getattr(building, name) for name in ("walls", "infills", "slabs")}
    for name, members in {**lists, **surfaces}.items():
        for n, member in enumerate(members):
            key = f"{name}[{n}]"
            if name in lists:
                require(member.section, building.sections, "section", f"{key}.section")
            else:
                building.check_material(member.material, key)
            if name in ("beams", "slabs"):
                resolve(member.floors, building.floors, "floor", f"{key}.floors")
            else:
                resolve(member.stories, building.story_names, "story", f"{key}.stories")


def _check_columns(building: FrameBuilding) -> None:
    grid = building.grid
    for n, columns in enumerate(building.columns):
        key = f"columns[{n}]"
        intersections(grid, columns.at, f"{key}.at")
        for name in resolve(columns.stories, building.story_names, "story", f"{key}.stories"):
            height = building.stories[building.story_names.index(name)].height
            if sum(columns.rigid_ends or ()) >= height - CLOSEST_LINES:
                text = f"they leave nothing of story {name}, {height:g} m high"
                raise Complaint(f"{key}.rigid_ends", f"{text}; shorten them")
        for m, point in enumerate(columns.points):
            for value, lines, axis in zip(point, (grid.x, grid.y), "xy", strict=True):
                low, high = min(lines.values()), max(lines.values())
                if not low <= value <= high:
                    text = f"{axis} = {value:g} m lies outside the grid ({low:g} to {high:g} m)"
                    mend = "add a grid line there or correct it"
                    raise Complaint(f"{key}.points[{m}]", f"{text}; {mend}")


def _check_stretches(building: FrameBuilding) -> None:
    """Where beams, braces, walls and slabs begin and end."""
    grid = building.grid
    for n, beams in enumerate(building.beams):
        key, rigid = f"beams[{n}]", sum(beams.rigid_ends or ())
        for stretch in beam_stretches(grid, beams, key):
            for start, end, length in spans(grid, stretch):
                if beams.rigid_ends is not None and rigid >= length - CLOSEST_LINES:
                    text = f"they leave nothing of the span {start} to {end} on {stretch.line}"
                    raise Complaint(f"{key}.rigid_ends", f"{text}, {length:g} m; shorten them")
    for n, braces in enumerate(building.braces):
        wall_stretch(grid, braces, f"braces[{n}]")
    for n, infill in enumerate(building.infills):
        wall_stretch(grid, infill, f"infills[{n}]")
    for n, wall in enumerate(building.walls):
        wall_stretch(grid, wall, f"walls[{n}]")
        for m, opening in enumerate(wall.openings):
            _check_opening(building, wall, opening, f"walls[{n}].openings[{m}]")
    for n, slab in enumerate(building.slabs):
        slab_lines(slab.x, grid.x, f"slabs[{n}].x")
        slab_lines(slab.y, grid.y, f"slabs[{n}].y")


def _check_opening(building: FrameBuilding, wall: Wall, opening: Opening, key: str) -> None:
    stretch = wall_stretch(building.grid, wall, key)
    low, high = stretch.ends(building.grid)
    if opening.left + opening.width > high - low + CLOSEST_LINES:
        text = f"the opening ends {opening.left + opening.width:g} m from {stretch.start}, the wall"
        raise Complaint(f"{key}.width", f"{text} at {high - low:g} m; make it narrower or move it")
    known = resolve(wall.stories, building.story_names, "story", f"{key}.stories")
    for story in resolve(opening.stories, known, "story of this wall", f"{key}.stories"):
        height = building.stories[building.story_names.index(story)].height
        if opening.bottom + opening.height > height + CLOSEST_LINES:
            text = f"the opening ends {opening.bottom + opening.height:g} m above the floor, story"
            raise Complaint(f"{key}.height", f"{text} {story} at {height:g} m; make it lower")


class ShearStory(Story):
    """One story of a shear building: its spring and the mass of the floor above.

    The stiffness is given as such, or divided by the mass of the floor above.
    """

    mass: Mass
    stiffness: Stiffness | None = None
    stiffness_per_mass: StiffnessPerMass | None = None
    height: Length | None = None

    def _complaints(self) -> Complaints:
        if (self.stiffness is None) == (self.stiffness_per_mass is None):
            yield ("stiffness", "give either stiffness or stiffness_per_mass, and not both")

    @property
    def spring(self) -> float:
        """The story's stiffness at theta = 1, N/m."""
        if self.stiffness is not None:
            return self.stiffness
        return (self.stiffness_per_mass or 0.0) * self.mass


class ShearBuilding(Building):
    """One mass and one spring a story; with masses unknown, forces are relative to the nominal."""

    kind: Literal["shear"]
    stories: tuple[ShearStory, ...]
    masses_known: Flag = True

    def _complaints(self) -> Complaints:
        base = "fixed" if self.supports is None else self.supports.base
        if base not in ("fixed", *RELEASED):
            yield ("supports.base", 'a stick is "fixed", "slides" or is "free"')
        if base == "free" and any(story.height is None for story in self.stories):
            yield (
                "supports",
                'base = "free" rocks: give every story its height, or write "slides"',
            )


def shear_operators(building: Building) -> tuple[Floats, Floats]:
    """Return the matrices of a building of kind "shear", in displacements relative to the base.

    They are one of stiffness a story (p, n, n), N/m, and that of the masses (n, n), kg, which is
    diagonal. The spring of story i acts on the difference between the floor above and the one below
    it (Clough and Penzien, 1993, section 11-1). BuildingError for a frame.
    """
    if not isinstance(building, ShearBuilding):
        raise BuildingError(
            f'{building.name}: kind: only a building of kind "shear" has these matrices; use '
            "mesh_building for a frame"
        )
    count = len(building.stories)
    drift = np.eye(count) - np.eye(count, k=-1)  # row i: floor above less floor below
    springs = np.array([story.spring for story in building.stories])
    terms = springs[:, None, None] * drift[:, :, None] * drift[:, None, :]
    return terms, np.diag([story.mass for story in building.stories])


def require_heights(building: Building) -> None:
    """Refuse a base that turns under a stick whose heights are not known."""
    if not isinstance(building, ShearBuilding):
        return
    unknown = [
        name
        for name, story in zip(building.story_names, building.stories, strict=True)
        if story.height is None
    ]
    if unknown:
        raise BuildingError(
            f"{building.name}: story {unknown[0]} has no height, and what a base that turns does to"
            " a building goes with height; give every story its height, or leave the vertical"
            " sensors of the base out"
        )


class MeshFile(Entry):
    """The mesh file, and how its coordinates are to be read."""

    file: Label  # path, relative to the building file
    unit: Literal["m", "cm", "mm", "in", "ft"]  # unit of its coordinates
    # of another program's model: unit of force, from which those of modulus and mass follow
    force: Literal["N", "kN", "MN", "kgf", "tf", "lbf", "kip"] | None = None
    base: Coordinate = 0.0  # level of the base in the mesh (z is up)
    # cell data that holds the groups' numbers, where the format has no named groups (VTU)
    tags: Label | None = None
    # how often every surface is made four, and every line two, where the mesh is coarse
    split: Literal[0, 1, 2] = 0
    # nodes nearer to each other than this become one; "0 m" leaves double nodes alone
    merge: LengthOrZero | None = None
    # groups whose cells are left out, or kinds of entries of another program's model
    ignore: Names | None = None
    # nonlinear materials and sections of a model that are taken at their initial stiffness
    elastic: Names | None = None
    # whether the elements of a model have their mass at their nodes
    mass: Literal["lumped", "consistent"] | None = None
    # diagonals of a model that are of less than this are struts of infills, the others braces
    infills: Stress | None = None
    # floors of a model that are rigid in plan, beside those that it names itself; or "none"
    diaphragms: Literal["none"] | Names | None = None


class Part(Entry):
    """The cells of some groups: shells with a thickness, or beams with a section."""

    group: Names  # names or numbers of groups in the mesh; "*" for all cells of that dimension
    thickness: Length | None = None  # of shells
    section: Label | None = None  # of beams, one of the building's
    # kind of element that the cells become, such as "shell"; the usual one of their type where left
    # out
    element: Label | None = None
    material: Label | None = None
    story: Label | None = None  # the story that owns the cells; by their height where left out
    # direction of the section's depth; vertical in beams, along y in upright columns
    up: tuple[Number, Number, Number] | None = None
    # "wall", "slab", "column" or "beam"; by the direction of each cell where left out
    kind: Literal["wall", "slab", "column", "beam"] | None = None
    # "rigid" where the shells of each floor move as one body in plan
    diaphragm: Literal["rigid"] | None = None
    # of beams, where their axis lies from the mesh's line, along x, y and z
    eccentricity: tuple[Coordinate, Coordinate, Coordinate] | None = None
    # of beams, lengths at the start and at the end of every span that do not bend
    rigid_ends: tuple[LengthOrZero, LengthOrZero] | None = None
    # "start", "end" or "both": ends of every span that pass no bending moment
    hinges: Literal["start", "end", "both"] | None = None

    @property
    def has_arms(self) -> bool:
        """Whether the axis leaves the mesh's line somewhere, or part of it is rigid."""
        return self.eccentricity is not None or self.rigid_ends is not None

    def _complaints(self) -> Complaints:
        if (self.thickness is None) == (self.section is None):
            text = "give a thickness (the cells are shells) or a section (they are beams)"
            yield ("thickness", text)
        wrong = ("column", "beam") if self.thickness is not None else ("wall", "slab")
        if self.kind in wrong:
            what = "shells" if self.thickness is not None else "beams"
            yield ("kind", f"{self.kind!r} does not fit {what}; correct or remove it")
        if self.up is not None and (self.section is None or not any(self.up)):
            yield ("up", "it is a direction (not 0, 0, 0) across beams; correct it")
        for name in ("eccentricity", "rigid_ends", "hinges"):
            if self.section is None and getattr(self, name) is not None:
                yield (name, "it is for beams, and these cells are shells; remove it")


class MeshSensors(SensorsAnywhere):
    """Where on each floor of a mesh motion is measured, by coordinates in plan.

    The sensor is at the node nearest to its point on the floor's level. `floors` overrides the
    points of single floors.
    """

    points: tuple[tuple[Coordinate, Coordinate], ...]
    floors: dict[str, tuple[tuple[Coordinate, Coordinate], ...]] = Field(default_factory=dict)

    def _complaints(self) -> Complaints:
        if not self.points:
            yield ("points", 'the list is empty; name a point, such as ["0 m", "3 m"]')
        for floor, points in self.floors.items():
            if not points:
                yield (f"floors.{floor}", "the list is empty; name a point or remove it")

    def of(self, floor: str) -> tuple[str, tuple[tuple[float, float], ...]]:
        """Return the key and the points of a floor."""
        if floor in self.floors:
            return f"sensors.floors.{floor}", self.floors[floor]
        return "sensors.points", self.points


class MeshBuilding(MeshedBuilding):
    """A building whose mesh comes from another program; groups of its cells become members."""

    kind: Literal["mesh"]
    mesh: MeshFile
    materials: dict[str, Material] = Field(default_factory=dict)
    parts: tuple[Part, ...] = ()
    sensors: MeshSensors

    def stories_at(self, points: Floats) -> Integers:
        """Index of the story that owns what lies at points (n, 3), -1 for none, (n,)."""
        levels, owner = np.array([-np.inf, *self.floor_levels]), np.full(len(points), -1)
        anywhere, zxy = (-np.inf, np.inf), points[:, [2, 0, 1]]
        for k, (story, foot) in enumerate(zip(self.stories, self.below, strict=True)):
            sides = ((levels[foot + 1] + 2 * LEVEL, levels[k + 1]), story.x, story.y)
            low, high = np.array([each or anywhere for each in sides]).T
            inside = (zxy > low - LEVEL) & (zxy <= high + LEVEL)
            owner[inside.all(axis=1)] = k
        return owner

    @property
    def from_program(self) -> bool:
        """Whether the file is another program's model, with members and masses of its own."""
        return program_of(self.mesh.file) is not None and not self.parts

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        for n, springs in enumerate(self.springs):
            if springs.at != ALL:
                text = 'a mesh has no grid lines; write "*" for all columns, or give points'
                raise Complaint(f"springs[{n}].at", text)
        if self.from_program:
            Building.check(self)
            if self.mesh.force is None:
                text = 'the key is missing; write the unit of force of the model, such as "N"'
                raise Complaint("mesh.force", text)
            for key in ("tags", "merge"):
                if getattr(self.mesh, key) is not None:
                    raise Complaint(f"mesh.{key}", "it is for meshes without members; remove it")
            for key in ("materials", "floor_mass"):
                if getattr(self, key):
                    raise Complaint(key, "the model has them; change them there, or give parts")
            if self.supports.base == "springs":
                text = "the model says what holds the base; put the springs there"
                raise Complaint("supports.base", text)
            rigid = self.mesh.diaphragms
            if rigid is not None and rigid != "none":
                resolve(rigid, self.floors, "floor", "mesh.diaphragms")
            return
        super().check()
        if not self.parts:
            raise Complaint("parts", "no group of the mesh has a meaning; add a [[parts]] table")
        for n, part in enumerate(self.parts):
            material = None
            if part.section is not None:
                require(part.section, self.sections, "section", f"parts[{n}].section")
                material = self.sections[part.section].material
            self.check_material(part.material or material, f"parts[{n}]")
            if part.story is not None:
                require(part.story, self.story_names, "story", f"parts[{n}].story")
