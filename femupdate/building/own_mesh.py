"""A building whose mesh another program made: where the mesh is, and what its groups mean."""

from typing import Literal

import numpy as np
from pydantic import Field

from femupdate.arrays import Floats, Integers
from femupdate.building.common import Building, MeshedBuilding
from femupdate.building.entry import Complaint, Complaints, Entry
from femupdate.building.members import Material, SensorsAnywhere
from femupdate.building.mesh_check import LEVEL
from femupdate.building.quantities import (
    ALL,
    Coordinate,
    Label,
    Length,
    LengthOrZero,
    Names,
    Number,
    Stress,
)
from femupdate.building.references import require, resolve
from femupdate.building.shipped import program_of


class MeshFile(Entry):
    """The mesh file, and how its coordinates are to be read."""

    file: Label  # path, relative to the building file
    unit: Literal["m", "cm", "mm", "in", "ft"]  # unit of its coordinates
    # of another program's model: unit of force, from which those of modulus and mass follow
    force: Literal["N", "kN", "MN", "kgf", "tf", "lbf", "kip"] | None = None
    base: Coordinate = 0.0  # level of the base in the mesh (z is up)
    # cell data that holds the groups' numbers, where the format has no named groups (VTU)
    tags: Label | None = None
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
            for floor in self.sensors.at:
                require(floor, self.floors, "floor", f"sensors.at.{floor}")
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
        if self.by_kind:
            text = "a mesh of parts has one factor a story; remove it"
            raise Complaint("parameters", text)
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
        for key in ("floors", "at"):
            for floor in getattr(self.sensors, key):
                require(floor, self.floors, "floor", f"sensors.{key}.{floor}")
