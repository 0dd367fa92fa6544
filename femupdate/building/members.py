"""The members of a frame building as data: materials, columns, beams, walls, slabs, supports."""

from typing import Literal

from pydantic import Field

from femupdate.building.entry import (
    ALL,
    Complaints,
    Coordinate,
    Damping,
    Density,
    Entry,
    Flag,
    Label,
    Length,
    LengthOrZero,
    Mass,
    Names,
    Number,
    Point,
    RotationalDamping,
    RotationalStiffness,
    Stiffness,
    Stress,
)


class Material(Entry):
    """An isotropic linear material."""

    youngs_modulus: Stress
    poisson_ratio: Number
    density: Density

    def _complaints(self) -> Complaints:
        if not 0.0 <= self.poisson_ratio < 0.5:
            yield (
                "poisson_ratio",
                f"{self.poisson_ratio:g} must lie from 0 to below 0.5; correct it",
            )


class Grid(Entry):
    """The grid lines: `x` names lines at a constant x, `y` lines at a constant y."""

    x: dict[str, Coordinate]
    y: dict[str, Coordinate]


class Story(Entry):
    """What every story has: a name."""

    name: Label


class FrameStory(Story):
    """One story of a frame building, floor to floor.

    It stands on the floor of the story `on`, or on the "base". Of a mesh that was read it owns what
    lies within `x` and `y` in plan; the last such story counts.
    """

    height: Length
    on: Label | None = None  # the story listed before where left out
    x: tuple[Coordinate, Coordinate] | None = None
    y: tuple[Coordinate, Coordinate] | None = None

    def _complaints(self) -> Complaints:
        for key, sides in (("x", self.x), ("y", self.y)):
            if sides is not None and not sides[0] < sides[1]:
                yield (key, f"it runs from {sides[0]:g} to {sides[1]:g} m; put the lower first")
        # A model on a bench has stories of 2 cm and more.
        if self.height < 0.02:
            yield (
                "height",
                f"a story {self.height * 1e3:.3g} mm high is none; is the unit wrong? Correct it",
            )


class ColumnGroup(Entry):
    """Columns of one section through these stories.

    They stand at intersections of grid lines ("X1-Y1"), or at `points` given by their coordinates.
    `eccentricity` is how far the axis stands from there, along x and y; rigid arms join the two.
    `rigid_ends` are lengths at the foot and at the head of every story that do not bend.
    """

    section: Label
    at: Names = ALL
    stories: Names = ALL
    points: tuple[tuple[Coordinate, Coordinate], ...] = ()
    eccentricity: tuple[Coordinate, Coordinate] | None = None
    rigid_ends: tuple[LengthOrZero, LengthOrZero] | None = None

    def _complaints(self) -> Complaints:
        if self.points and self.at != ALL:
            text = "give either intersections (at) or coordinates (points); put the others into"
            yield ("points", f"{text} another [[columns]] table")


class BeamLines(Entry):
    """BeamLines of one section along grid lines, over the whole line or between two crossing lines.

    `eccentricity` is how far the axis lies below the floor's plane. `rigid_ends` (at the start and
    at the end) and `hinges` are those of every span, from one crossing grid line to the next.
    """

    section: Label
    along: Names = ALL
    start: Label | None = Field(default=None, alias="from")
    end: Label | None = Field(default=None, alias="to")
    floors: Names = ALL
    eccentricity: Coordinate | None = None
    rigid_ends: tuple[LengthOrZero, LengthOrZero] | None = None
    hinges: Literal["start", "end", "both"] | None = None


class Braces(Entry):
    """Straight members across a bay between two crossing lines, from floor to floor.

    "up" runs from the first line below to the second above, "down" from the first above to the
    second below, "cross" is both, which pass without touching.
    """

    section: Label
    along: Label
    start: Label = Field(alias="from")
    end: Label = Field(alias="to")
    stories: Names = ALL
    shape: Literal["up", "down", "cross"] = "up"
    ends: Literal["pinned", "rigid"] = "pinned"


class InfillWall(Entry):
    """Masonry between columns and beams, as two diagonal struts across every bay of its stretch.

    Bays reach from column to column; `formula` gives the width that both struts have together.
    """

    along: Label
    start: Label = Field(alias="from")
    end: Label = Field(alias="to")
    thickness: Length
    formula: Literal["FEMA 356", "EN 1998-1"]
    stories: Names = ALL
    material: Label | None = None


class Opening(Entry):
    """A rectangular hole in a wall: a door, a window, the space over a spandrel wall.

    `left` is measured from the wall's first line along the wall, `bottom` from the floor below.
    """

    left: LengthOrZero
    width: Length
    bottom: LengthOrZero
    height: Length
    stories: Names = ALL


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
    openings: tuple[Opening, ...] = ()

    @property
    def is_stiff(self) -> bool:
        """Whether the wall is meshed: as `stiffness` says, else only where its role is "shear"."""
        return self.role == "shear" if self.stiffness is None else self.stiffness


class Slab(Entry):
    """A rectangular slab between two lines of each family, on these floors.

    With a rigid diaphragm all its nodes move as one body in plan; it still bends out of its plane.
    """

    x: tuple[Label, Label]
    y: tuple[Label, Label]
    thickness: Length
    floors: Names = ALL
    material: Label | None = None
    diaphragm: Literal["rigid"] | None = None


class FloorMass(Entry):
    """Total mass of each of these floors, the self weight of what its story owns included.

    Story i owns the columns and walls between floors i and i+1 and the slab and beams of floor
    i+1. What the total leaves after their self weight is spread over the slab.
    """

    total: Mass
    floors: Names = ALL


SPRING_KEYS = ("kx", "ky", "kz", "krx", "kry", "krz")


class SixSprings(Entry):
    """A spring along and about each axis, with a dashpot beside it; None where there is none."""

    kx: Stiffness | None = None
    ky: Stiffness | None = None
    kz: Stiffness | None = None
    krx: RotationalStiffness | None = None
    kry: RotationalStiffness | None = None
    krz: RotationalStiffness | None = None
    cx: Damping | None = None
    cy: Damping | None = None
    cz: Damping | None = None
    crx: RotationalDamping | None = None
    cry: RotationalDamping | None = None
    crz: RotationalDamping | None = None

    @property
    def springs(self) -> tuple[float | None, ...]:
        """Stiffness along x, y, z and about x, y, z, N/m and N m/rad."""
        return (self.kx, self.ky, self.kz, self.krx, self.kry, self.krz)

    @property
    def dashpots(self) -> tuple[float | None, ...]:
        """Damping along x, y, z and about x, y, z, N s/m and N m s/rad."""
        return (self.cx, self.cy, self.cz, self.crx, self.cry, self.crz)

    def _complaints(self) -> Complaints:
        for key, k, c in zip(SPRING_KEYS, self.springs, self.dashpots, strict=True):
            if c is not None and k is None:
                text = f"a dashpot needs a spring beside it; give {key} or remove it"
                yield (f"c{key[1:]}", text)


class SpringGroup(SixSprings):
    """Alike springs to the ground: isolators, piles, soil under single footings or beside a wall.

    Each stands under a column ("*": under all), or at the node nearest to a point (x, y, z). In its
    own directions it takes the place of the support there.
    """

    at: Names = ALL
    points: tuple[Point, ...] = ()

    def _complaints(self) -> Complaints:
        if not any(self.springs):
            yield ("kx", f"give a stiffness, one of {', '.join(SPRING_KEYS)}")
        if self.points and self.at != ALL:
            yield ("points", "give either columns (at) or points; write two tables")


RELEASED = ("slides", "free")


class Base(Entry):
    """Whether forces move the base: "slides" along the motion, "free" rocks as well.

    `mass` is that of what moves with the base, such as a plate under the columns.
    """

    base: Literal["fixed", "pinned", "springs", "slides", "free"] = "fixed"
    mass: Mass | None = None

    def _complaints(self) -> Complaints:
        if self.mass is not None and self.base not in RELEASED:
            yield ("mass", f'it needs base = "slides" or "free", not {self.base!r}; change one')


class Supports(Base, SixSprings):
    """How the nodes at the base are held.

    "fixed" holds them in all six directions, "pinned" in three. With "springs" they are one rigid
    footing on springs in the middle of its plan, whose stiffnesses are those of the whole
    foundation; a direction without a stiffness is held.
    With "slides" and "free" (see `Base`) they are clamped to a base that moves as one.
    """

    def _complaints(self) -> Complaints:
        given = [key for key, k in zip(SPRING_KEYS, self.springs, strict=True) if k is not None]
        if self.base == "springs" and not given:
            yield ("kx", f"springs need a stiffness; write one of {', '.join(SPRING_KEYS)}")
        if self.base != "springs" and given:
            yield (given[0], f'it needs base = "springs", not {self.base!r}; change one')


class Mesh(Entry):
    """The largest length of an element's side."""

    size: Length


class SensorsAnywhere(Entry):
    """Which horizontal direction is measured, and where on floors that are no plane.

    `at` has points (x, y, z) of single floors, whose nearest nodes are measured: on mezzanines,
    split levels, sloping roofs.
    """

    direction: Literal["x", "y"]
    at: dict[str, tuple[Point, ...]] = Field(default_factory=dict)

    def _complaints(self) -> Complaints:
        for floor, points in self.at.items():
            if not points:
                yield (f"at.{floor}", "the list is empty; name a point or remove it")


class Sensors(SensorsAnywhere):
    """Where on each floor of a grid motion is measured.

    A floor's response is the mean over its points, which are intersections of grid lines.
    `floors` overrides the points of single floors.
    """

    points: Names
    floors: dict[str, Names] = Field(default_factory=dict)

    def of(self, floor: str) -> tuple[str, tuple[str, ...]]:
        """Return the key and the points of a floor."""
        if floor in self.floors:
            return f"sensors.floors.{floor}", self.floors[floor]
        return "sensors.points", self.points
