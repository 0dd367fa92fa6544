"""A building of one mass and one spring a story, and its matrices."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.common import Building
from femupdate.building.entry import Complaints
from femupdate.building.members import RELEASED, Story
from femupdate.building.quantities import Flag, Length, Mass, Stiffness, StiffnessPerMass
from femupdate.errors import BuildingError


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
            text = "give either stiffness or stiffness_per_mass, and not both"
            yield ("stiffness", text)

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


@dataclass(frozen=True)
class ShearOperators:
    """K(theta) = sum_i theta_i stiffness_terms[i], in displacements relative to the base."""

    stiffness_terms: Floats  # (p, n, n) one a story, N/m
    mass: Floats  # (n, n) diagonal, kg


def shear_operators(building: Building) -> ShearOperators:
    """Return the matrices of a building of kind "shear".

    The spring of story i acts on the difference between the floor above and the one below it
    (Clough and Penzien, 1993, section 11-1).

    Raises:
        BuildingError: the building is a frame.
    """
    if not isinstance(building, ShearBuilding):
        raise BuildingError(
            f'{building.name}: kind: only a building of kind "shear" has these matrices; use '
            "mesh_building for a frame"
        )
    count = len(building.stories)
    drift = np.eye(count) - np.eye(count, k=-1)  # row i: floor above less floor below
    springs = np.array([story.spring for story in building.stories])
    return ShearOperators(
        stiffness_terms=springs[:, None, None] * drift[:, :, None] * drift[:, None, :],
        mass=np.diag([story.mass for story in building.stories]),
    )


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
