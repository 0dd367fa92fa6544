"""The matrices of a shear building: one mass a floor, one spring a story."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.schema import Building, ShearBuilding
from femupdate.errors import BuildingError


@dataclass(frozen=True)
class ShearOperators:
    """K(theta) = sum_i theta_i stiffness_terms[i], in displacements relative to the base.

    Attributes:
        stiffness_terms: (p, n, n) one a story, N/m.
        mass: (n, n) diagonal, kg.
        floors: names of the n floors, bottom to top.
        story_names: names of the p = n stories, bottom to top.
        masses_known: False where masses are nominal and forces therefore relative.
    """

    stiffness_terms: Floats
    mass: Floats
    floors: tuple[str, ...]
    story_names: tuple[str, ...]
    masses_known: bool


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
        floors=building.floors,
        story_names=building.story_names,
        masses_known=building.masses_known,
    )
