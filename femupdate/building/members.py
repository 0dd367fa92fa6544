"""The members of a frame building as data: materials, sections, columns, beams, walls, slabs."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from femupdate.building.entry import Complaint, Entry
from femupdate.building.quantities import (
    ALL,
    Area,
    Coordinate,
    Density,
    Flag,
    Inertia,
    Label,
    Length,
    Mass,
    Names,
    Number,
    Stress,
)

_SHEAR_SHARE = 5.0 / 6.0  # effective shear area of a rectangle over its area (Timoshenko, 1921)


class Material(Entry):
    """An isotropic linear material."""

    youngs_modulus: Stress
    poisson_ratio: Number
    density: Density

    @model_validator(mode="after")
    def _stable(self) -> "Material":
        if not 0.0 <= self.poisson_ratio < 0.5:
            raise Complaint(
                "poisson_ratio", f"{self.poisson_ratio:g} must lie from 0 to below 0.5; correct it"
            )
        return self


@dataclass(frozen=True)
class SectionFigures:
    """What a beam element needs to know of its section (m2, m4).

    y is the direction of the width, z that of the depth: a column's width lies along x and its
    depth along y, a beam's width is horizontal and its depth vertical. `inertia_y` resists bending
    with displacement along z.
    """

    area: float
    shear_area_y: float
    shear_area_z: float
    inertia_y: float
    inertia_z: float
    torsion_constant: float


def rectangle_torsion_constant(width: float, depth: float) -> float:
    """Return Saint-Venant's torsion constant of a solid rectangle, m4.

    The series of Timoshenko and Goodier (Theory of Elasticity, 1951, article 94), for sides
    a >= b: J = a b^3 (1/3 - 64 b / (pi^5 a) sum over odd n of tanh(n pi a / 2 b) / n^5).
    """
    long, short = max(width, depth), min(width, depth)
    odd = np.arange(1, 100, 2)  # the rest of the series is below 1e-10 of the result
    series = np.sum(np.tanh(odd * np.pi * long / (2.0 * short)) / odd**5.0)
    return float(long * short**3 * (1.0 / 3.0 - 64.0 * short / (np.pi**5 * long) * series))


class RectangleSection(Entry):
    """A solid rectangle."""

    shape: Literal["rectangle"]
    width: Length
    depth: Length
    material: Label | None = None

    def figures(self) -> SectionFigures:
        """Return the section's figures; the shear areas are 5/6 of the area."""
        area = self.width * self.depth
        return SectionFigures(
            area=area,
            shear_area_y=_SHEAR_SHARE * area,
            shear_area_z=_SHEAR_SHARE * area,
            inertia_y=self.width * self.depth**3 / 12.0,
            inertia_z=self.depth * self.width**3 / 12.0,
            torsion_constant=rectangle_torsion_constant(self.width, self.depth),
        )


class FiguresSection(Entry):
    """A section of any shape, given by its figures (axes as in `SectionFigures`)."""

    shape: Literal["figures"]
    area: Area
    shear_area_y: Area
    shear_area_z: Area
    inertia_y: Inertia
    inertia_z: Inertia
    torsion_constant: Inertia
    material: Label | None = None

    def figures(self) -> SectionFigures:
        """Return the section's figures."""
        return SectionFigures(
            area=self.area,
            shear_area_y=self.shear_area_y,
            shear_area_z=self.shear_area_z,
            inertia_y=self.inertia_y,
            inertia_z=self.inertia_z,
            torsion_constant=self.torsion_constant,
        )


Section = Annotated[RectangleSection | FiguresSection, Field(discriminator="shape")]


class Grid(Entry):
    """The grid lines: `x` names lines at a constant x, `y` lines at a constant y."""

    x: dict[str, Coordinate]
    y: dict[str, Coordinate]


class Story(Entry):
    """What every story has: a name."""

    name: Label


class FrameStory(Story):
    """One story of a frame building, floor to floor."""

    height: Length


class Columns(Entry):
    """Columns of one section at intersections of grid lines ("X1-Y1"), through these stories."""

    section: Label
    at: Names = ALL
    stories: Names = ALL


class Beams(Entry):
    """Beams of one section along grid lines, over the whole line or between two crossing lines."""

    section: Label
    along: Names = ALL
    start: Label | None = Field(default=None, alias="from")
    end: Label | None = Field(default=None, alias="to")
    floors: Names = ALL


class Wall(Entry):
    """A wall along a grid line between two crossing lines, through these stories.

    A wall without stiffness weighs on the floors above and below it and does nothing else.
    """

    along: Label
    start: Label = Field(alias="from")
    end: Label = Field(alias="to")
    thickness: Length
    role: Literal["shear", "non_structural"] = "shear"
    stiffness: Flag | None = None
    stories: Names = ALL
    material: Label | None = None

    @property
    def is_stiff(self) -> bool:
        """Whether the wall is meshed: as `stiffness` says, else only where its role is "shear"."""
        return self.role == "shear" if self.stiffness is None else self.stiffness


class Slab(Entry):
    """A rectangular slab between two lines of each family, on these floors."""

    x: tuple[Label, Label]
    y: tuple[Label, Label]
    thickness: Length
    floors: Names = ALL
    material: Label | None = None


class FloorMass(Entry):
    """Total mass of each of these floors, the self weight of what its story owns included.

    Story i owns the columns and walls between floors i and i+1 and the slab and beams of floor
    i+1. What the total leaves after their self weight is spread over the slab.
    """

    total: Mass
    floors: Names = ALL


class Supports(Entry):
    """How the nodes at the base are held: "fixed" in all six directions, "pinned" in three."""

    base: Literal["fixed", "pinned"] = "fixed"


class Mesh(Entry):
    """The largest length of an element's side."""

    size: Length


class Sensors(Entry):
    """Which horizontal direction is measured, and where on each floor.

    A floor's response is the mean over its points, which are intersections of grid lines.
    `floors` overrides the points of single floors.
    """

    direction: Literal["x", "y"]
    points: Names
    floors: dict[str, Names] = Field(default_factory=dict)
