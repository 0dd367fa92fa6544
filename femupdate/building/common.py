"""What building files of every kind hold, validated (SI inside)."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import cast

import numpy as np
from pydantic import Field, model_validator

from femupdate.arrays import Floats
from femupdate.building.analysis import (
    Damping,
    EffectEntry,
    FrequencyGrid,
    ObservationSettings,
    Prior,
    ReductionSettings,
)
from femupdate.building.entry import Complaint, Entry, unknown
from femupdate.building.members import Base, FloorMass, FrameStory, Material, Story, Supports
from femupdate.building.quantities import Flag, Label
from femupdate.building.references import require, resolve
from femupdate.building.sections import Section

BASE = "base"


def floor_names(stories: int) -> tuple[str, ...]:
    """Return the floors above each story: "2F", "3F", ..., and "RF" for the roof."""
    return (*(f"{number}F" for number in range(2, stories + 1)), "RF")


class Building(Entry):
    """A building as its file says: stories, frequencies, priors, damping and listed effects.

    Its kinds are `FrameBuilding`, `MeshBuilding` and `ShearBuilding`.

        >>> import femupdate
        >>> building = femupdate.Building.load("shear_3dof")
        >>> building.floors, building.story_names
        (('2F', '3F', 'RF'), ('S1', 'S2', 'S3'))
    """

    name: Label
    title: str = ""
    description: str = ""
    stories: tuple[Story, ...]
    frequency_grid: FrequencyGrid
    prior: Prior
    damping: Damping
    observation: ObservationSettings = ObservationSettings()
    reduction: ReductionSettings = ReductionSettings()
    effects: tuple[EffectEntry, ...] = ()
    # Where the figures come from, in the words of the file's author; nothing here reads it.
    provenance: Mapping[str, str | tuple[str, ...]] = Field(default_factory=dict)
    # What is left out of the document, and so of its hash, where it is not said.
    masses_known: Flag | None = None
    supports: Base | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "Building":
        self.check()
        return self

    @cached_property
    def source(self) -> str:
        """The text of the file that it was read from, with its comments; empty without one."""
        return ""

    @staticmethod
    def load(path_or_name: str | Path) -> "Building":
        """A building of any kind by its file or its shipped name.

        Raises:
            BuildingError: no such building, or its file is wrong.
        """
        # What reads files knows the kinds, which are built on this class.
        read = import_module("femupdate.building.files").load_building
        return cast(Building, read(path_or_name))

    @property
    def story_names(self) -> tuple[str, ...]:
        """Names of the stories, bottom to top."""
        return tuple(story.name for story in self.stories)

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors above each story, "2F" to "RF"."""
        return floor_names(len(self.stories))

    @property
    def by_kind(self) -> bool:
        """Whether members of different kinds have stiffness factors of their own."""
        return False

    @property
    def forces_are_relative(self) -> bool:
        """Whether masses are nominal, so that only stiffness over mass can be known."""
        return self.masses_known is False

    @property
    def moving_base(self) -> str:
        """What the base does under forces: "slides" or "is free"; empty where it is held."""
        base = "fixed" if self.supports is None else self.supports.base
        return {"slides": "slides", "free": "is free"}.get(base, "")

    def doubts(self) -> tuple[str, ...]:
        """What an engineer would ask about the figures, a sentence each."""
        return ()

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        _check_story_names(self.story_names)
        for name in self.prior.stories:
            if name not in self.story_names:
                raise Complaint(f"prior.stories.{name}", unknown("story", name, self.story_names))
        if self.prior.zeta is not None and self.damping.is_rayleigh:
            text = "Rayleigh damping is fixed by its anchors; remove the prior, or use constant"
            raise Complaint("prior.zeta", f"{text} damping")


def _check_story_names(names: Iterable[str]) -> None:
    seen: list[str] = []
    for number, name in enumerate(names):
        if name in seen:
            text = f"{name!r} is the name of stories[{seen.index(name)}] already; rename one"
            raise Complaint(f"stories[{number}].name", text)
        seen.append(name)
    if not seen:
        raise Complaint("stories", "the building has no story; add a [[stories]] table")


class MeshedBuilding(Building):
    """A building with a finite-element mesh: materials, sections, floor masses and supports."""

    stories: tuple[FrameStory, ...]
    materials: dict[str, Material]
    sections: dict[str, Section] = Field(default_factory=dict)
    floor_mass: tuple[FloorMass, ...] = ()
    supports: Supports = Supports()

    @property
    def floor_levels(self) -> Floats:
        """Heights of the floors above the base, (stories,) m."""
        return np.cumsum([story.height for story in self.stories])

    def material(self, name: str | None) -> Material:
        """Return the named material; None means the only one of the building."""
        return self.materials[name] if name is not None else next(iter(self.materials.values()))

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        super().check()
        if not self.materials:
            text = "the building has no material; add a [materials.NAME] table"
            raise Complaint("materials", text)
        for name, section in self.sections.items():
            self.check_material(section.material, f"sections.{name}")
        given: dict[str, int] = {}
        for n, mass in enumerate(self.floor_mass):
            key = f"floor_mass[{n}].floors"
            for floor in resolve(mass.floors, self.floors, "floor", key):
                if floor in given:
                    text = f"floor_mass[{given[floor]}] gives the mass of {floor} already"
                    raise Complaint(key, f"{text}; remove one")
                given[floor] = n

    def doubts(self) -> tuple[str, ...]:
        """What an engineer would ask about the figures, a sentence each."""
        asked = {f"materials.{name}": material.doubt() for name, material in self.materials.items()}
        return tuple(f"{key}: {text}" for key, text in asked.items() if text)

    def check_material(self, name: str | None, key: str) -> None:
        """Raise Complaint where a member names no material, or one that is not there."""
        if name is not None:
            require(name, self.materials, "material", f"{key}.material")
        elif len(self.materials) != 1:
            names = ", ".join(self.materials)
            text = f"the key is missing; name one of the materials {names}"
            raise Complaint(f"{key}.material", text)
