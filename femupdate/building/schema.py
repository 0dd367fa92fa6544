"""The building as data: what a building file holds, validated (SI inside).

Three kinds of building share the frequencies, priors, damping and provenance: a `FrameBuilding` of
columns, beams, walls and slabs, a `MeshBuilding` whose mesh somebody else made, and a
`ShearBuilding` of one mass and one spring a story.
"""

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from femupdate.arrays import Floats
from femupdate.building.analysis import (
    Damping,
    FrequencyGrid,
    Observation,
    Prior,
    Provenance,
    Reduction,
)
from femupdate.building.checks import (
    check_frame,
    check_mesh_building,
    check_prior,
    check_story_names,
)
from femupdate.building.effect_entry import EffectEntry
from femupdate.building.entry import Complaint, Entry
from femupdate.building.members import (
    Beams,
    Columns,
    FloorMass,
    FrameStory,
    Grid,
    Material,
    Mesh,
    Sensors,
    Slab,
    Story,
    Supports,
    Wall,
)
from femupdate.building.mesh_entries import MeshFile, MeshSensors, Part
from femupdate.building.parameters import Parameters
from femupdate.building.quantities import Flag, Label, Length, Mass, Stiffness, StiffnessPerMass
from femupdate.building.sections import Section

BASE = "base"


def floor_names(stories: int) -> tuple[str, ...]:
    """Return the floors above each story: "2F", "3F", ..., and "RF" for the roof."""
    return (*(f"{number}F" for number in range(2, stories + 1)), "RF")


class _Common(Entry):
    """What both kinds of building have."""

    name: Label
    title: str = ""
    description: str = ""
    stories: tuple[Story, ...]
    frequency_grid: FrequencyGrid
    prior: Prior
    damping: Damping
    observation: Observation = Observation()
    reduction: Reduction = Reduction()
    effects: tuple[EffectEntry, ...] = ()
    provenance: Provenance = Provenance()

    @property
    def story_names(self) -> tuple[str, ...]:
        """Names of the stories, bottom to top."""
        return tuple(story.name for story in self.stories)

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors above each story, "2F" to "RF"."""
        return floor_names(len(self.stories))


class FrameBuilding(_Common):
    """A building of columns, beams, walls and slabs on a grid of named lines."""

    kind: Literal["frame"]
    grid: Grid
    stories: tuple[FrameStory, ...]
    materials: dict[str, Material]
    sections: dict[str, Section] = Field(default_factory=dict)
    columns: tuple[Columns, ...] = ()
    beams: tuple[Beams, ...] = ()
    walls: tuple[Wall, ...] = ()
    slabs: tuple[Slab, ...] = ()
    floor_mass: tuple[FloorMass, ...] = ()
    supports: Supports = Supports()
    mesh: Mesh
    sensors: Sensors
    parameters: Parameters | None = None  # none in files (and their hashes) that do not say it

    @model_validator(mode="after")
    def _consistent(self) -> "FrameBuilding":
        check_frame(self)
        return self

    @property
    def floor_levels(self) -> Floats:
        """Heights of the floors above the base, (stories,) m."""
        return np.cumsum([story.height for story in self.stories])

    def material(self, name: str | None) -> Material:
        """Return the named material; None means the only one of the building."""
        return self.materials[name] if name is not None else next(iter(self.materials.values()))


class MeshBuilding(_Common):
    """A building whose mesh comes from another program; groups of its cells become members."""

    kind: Literal["mesh"]
    stories: tuple[FrameStory, ...]
    materials: dict[str, Material]
    sections: dict[str, Section] = Field(default_factory=dict)
    mesh: MeshFile
    parts: tuple[Part, ...]
    floor_mass: tuple[FloorMass, ...] = ()
    supports: Supports = Supports()
    sensors: MeshSensors

    @model_validator(mode="after")
    def _consistent(self) -> "MeshBuilding":
        check_mesh_building(self)
        return self

    @property
    def floor_levels(self) -> Floats:
        """Heights of the floors above the base, (stories,) m."""
        return np.cumsum([story.height for story in self.stories])

    def material(self, name: str | None) -> Material:
        """Return the named material; None means the only one of the building."""
        return self.materials[name] if name is not None else next(iter(self.materials.values()))


class ShearStory(Story):
    """One story of a shear building: its spring and the mass of the floor above.

    The stiffness is given as such, or divided by the mass of the floor above.
    """

    mass: Mass
    stiffness: Stiffness | None = None
    stiffness_per_mass: StiffnessPerMass | None = None
    height: Length | None = None

    @model_validator(mode="after")
    def _one_stiffness(self) -> "ShearStory":
        if (self.stiffness is None) == (self.stiffness_per_mass is None):
            text = "give either stiffness or stiffness_per_mass, and not both"
            raise Complaint("stiffness", text)
        return self

    @property
    def spring(self) -> float:
        """The story's stiffness at theta = 1, N/m."""
        if self.stiffness is not None:
            return self.stiffness
        return (self.stiffness_per_mass or 0.0) * self.mass


class ShearBuilding(_Common):
    """One mass and one spring a story; with masses unknown, forces are relative to the nominal."""

    kind: Literal["shear"]
    stories: tuple[ShearStory, ...]
    masses_known: Flag = True

    @model_validator(mode="after")
    def _consistent(self) -> "ShearBuilding":
        check_story_names(self.story_names)
        check_prior(self.prior, self.damping, self.story_names)
        return self


Building = FrameBuilding | MeshBuilding | ShearBuilding
