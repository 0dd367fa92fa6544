"""What SAP2000 and ETABS share: rows of text, local axes, modifiers, insertion, mass sources."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.deck_model import SHAPES
from femupdate.building.model_tables import ModelTables, Stuff
from femupdate.building.sections import SectionFigures
from femupdate.errors import BuildingError
from femupdate.fe.element import area_vectors

FORCES = {"n": "N", "kn": "kN", "kgf": "kgf", "tonf": "tf", "lb": "lbf", "kip": "kip"}
LENGTHS = ("m", "cm", "mm", "in", "ft")
FRAME_MODIFIERS = ("A", "AS2", "AS3", "J", "I22", "I33", "M", "W")
AREA_MODIFIERS = ("F11", "F22", "F12", "M11", "M22", "M12", "V13", "V23", "M", "W")
# What a released force is in our beams, whose z axis is their 2 and whose y axis is their -3.
_RELEASES = {"P": 0, "V2": 2, "V3": 1, "T": 3, "M2": 5, "M3": 4}
GRAVITY = 9.80665
_NO = ("no", "false", "0", "none", "")


@dataclass(frozen=True)
class Row:
    """A row of a table or section."""

    file: str
    table: str
    line: int
    values: Mapping[str, str]
    read: set[str] = field(default_factory=set)  # keys that were asked for

    def error(self, text: str) -> BuildingError:
        """A complaint about this row, with its file and line."""
        name = next(iter(self.values.values()), "")
        return BuildingError(f"{self.file}, line {self.line}: {self.table} {name}: {text}")

    def text(self, *keys: str) -> str:
        """The first of these keys that is there; empty without one."""
        self.read.update(keys)
        return next((self.values[key] for key in keys if key in self.values), "")

    def named(self, *keys: str) -> str:
        """As `text`, of what must be there."""
        text = self.text(*keys)
        if not text:
            raise self.error(f"{keys[0]} is missing; export the table again with it")
        return text

    def flag(self, key: str, usual: bool = False) -> bool:
        """Yes or no."""
        text = self.text(key)
        return usual if not text else text.lower() not in _NO

    def real(self, *keys: str, usual: float | None = None) -> float:
        """A number; a decimal comma is one as well."""
        text = self.text(*keys)
        if not text and usual is not None:
            return usual
        try:
            value = float(text.replace(",", "."))
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            said = f"is {text!r}" if text else "is missing"
            raise self.error(f"{keys[0]} {said}; write a number")
        return value


def units_of(file: str, words: Iterable[str]) -> tuple[str, str]:
    """Units of force and length from the words of a file.

    Raises:
        BuildingError: they are not known.
    """
    force, length, *_ = [*(word.strip().lower() for word in words), "", ""]
    if force not in FORCES or length not in LENGTHS:
        raise BuildingError(
            f"{file}: its units {force!r} and {length!r} are not known; export it in kN and m"
        )
    return FORCES[force], length


def once(rows: Iterable[Row], *keys: str) -> dict[str, Row]:
    """Rows by their name, which no two may share."""
    known: dict[str, Row] = {}
    for row in rows:
        name = row.named(*keys)
        if name in known:
            text = f"line {known[name].line} has this name already"
            raise row.error(f"{text}; rename or remove one")
        known[name] = row
    return known


@dataclass(frozen=True)
class FrameSection:
    """A section with its material and modifiers."""

    figures: SectionFigures
    stuff: Stuff
    weight: float  # of the material, N/m3
    modifiers: tuple[float, ...]  # as `FRAME_MODIFIERS`


@dataclass(frozen=True)
class AreaSection:
    """A section of areas."""

    name: str
    stuff: Stuff
    weight: float  # of the material, N/m3
    thickness: float  # m
    bending: float  # thickness for bending, m; 0 for a membrane
    modifiers: tuple[float, ...]  # as `AREA_MODIFIERS`
    more_weight: float = 0.0  # N/m2, such as of a deck


@dataclass
class MassSource:
    """What is mass: the elements themselves, added masses, and shares of load patterns."""

    elements: bool = True
    added: bool = True
    patterns: dict[str, float] = field(default_factory=dict)
    self_weight: float = 0.0  # how often the self weight is in these patterns

    def add(self, pattern: str, share: float, self_weight: float) -> None:
        """Add a share of a load pattern, in which the self weight is so often."""
        self.patterns[pattern] = self.patterns.get(pattern, 0.0) + share
        self.self_weight += share * self_weight

    def told(self, tables: ModelTables) -> "MassSource":
        """List what it takes of loads among the changes."""
        if self.patterns:
            listed = ", ".join(f"{share:g} {name}" for name, share in self.patterns.items())
            tables.changes[f"mass source: loads {listed} over g"] += 1
        return self


def material_of(tables: ModelTables, row: Row) -> tuple[Stuff, float]:
    """A material, by the keys of either program, and its weight, N/m3."""
    young, shear = row.real("E", "E1"), row.real("G12", usual=0.0)
    ratio = row.real("U", "U12", usual=0.5 * young / shear - 1.0 if shear else 0.2)
    weight = row.real("WEIGHTPERVOLUME", "UnitWeight", usual=0.0)
    density = row.real("MASSPERVOLUME", "UnitMass", usual=weight * tables.length / GRAVITY)
    stuff = tables.material(row, young, ratio, density, shear)
    return stuff, weight * tables.force / tables.length**3


def frame_figures(tables: ModelTables, row: Row) -> SectionFigures:
    """Figures of a section, as they are given or as its sides make them, by either's keys.

    Raises:
        BuildingError: the shape is not known, or the sides make none.
    """
    keys = (("D", "t3"), ("B", "t2"), ("TF", "tf", "T"), ("TW", "tw", "T"))
    d, b, flange, web = (tables.length * row.real(*names, usual=0.0) for names in keys)
    shape = row.text("SHAPE", "Shape")
    if row.text("AREA", "Area"):
        names = (("I33",), ("I22",), ("J", "TorsConst"), ("AS2",), ("AS3",))
        i33, i22, torsion, *shear = (row.real(*keys_of, usual=0.0) for keys_of in names)
        return tables.section(row, row.real("AREA", "Area"), (i33, i22), torsion, shear)
    words = shape.lower()
    known = {
        "rectangular": ("BAR", (b, d)),
        "circle": ("ROD", (d / 2.0,)),
        "pipe": ("TUBE", (d / 2.0, d / 2.0 - (web or flange))),
        "tube": ("BOX", (b, d, flange, web)),
        "wide flange": ("I", (d, b, b, web, flange, flange)),
        "tee": ("T", (b, d, flange, web)),
    }
    name = next((name for word, name in known.items() if word in words), None)
    if name is None or not d > 0.0:
        raise row.error(
            f"its shape {shape!r} is not known, or its sides are missing; give its figures "
            "(General), or one of Rectangular, Circle, Pipe, Tube, I/Wide Flange, Tee"
        )
    try:
        return SHAPES[name[0]][1](*name[1])
    except ValueError:
        raise row.error(f"its sides make no {shape}; correct them") from None


def local_axes(axis: Floats, angle: float) -> Floats:
    """Local axes 1, 2 and 3 as rows, (3, 3): 2 is upwards, or along x in upright frames."""
    first = axis / np.linalg.norm(axis)
    upright = float(np.hypot(first[0], first[1])) < 1e-3  # sine of the angle to the vertical
    second = np.eye(3)[0 if upright else 2]
    second = second - (second @ first) * first
    second /= np.linalg.norm(second)
    third, turn = np.cross(first, second), np.deg2rad(angle)
    second = np.cos(turn) * second + np.sin(turn) * third
    return np.stack([first, second, np.cross(first, second)])


def add_frame(
    tables: ModelTables,
    row: Row,
    ends: list[int],
    section: FrameSection,
    source: MassSource,
    *,
    angle: float = 0.0,
    released: Iterable[str] = (),
    rigid: Sequence[float] = (0.0, 0.0, 0.0),
    cardinal: int = 10,
    moved: Floats | None = None,
    modifiers: Sequence[float] = (1.0,) * 8,
    load: float = 0.0,
) -> None:
    """Add a frame with all that is assigned to it.

    Args:
        released: such as "M3I".
        rigid: lengths of its end offsets in the file's unit, and the share that is rigid.
        cardinal: point of the section that lies on the line, 10 for the centroid.
        moved: (2, 3) offsets of its ends in global axes, in the file's unit.
        load: what else is mass, kg/m.
    """
    span = tables.points[ends[1]] - tables.points[ends[0]]
    length = float(np.linalg.norm(span))
    if not length > 0.0:
        raise row.error("it has no length; move a joint or remove it")
    axes = local_axes(span, angle)
    factor = np.array(section.modifiers) * np.array(modifiers)
    changed = [f"{n} {v:.3g}" for n, v in zip(FRAME_MODIFIERS, factor, strict=True) if v != 1.0]
    if changed:
        tables.changes[f"frames with modifiers {', '.join(changed)}"] += 1
    own = section.figures
    figures = replace(
        own,
        area=own.area * factor[0],
        shear_area_z=own.shear_area_z * factor[1],
        shear_area_y=own.shear_area_y * factor[2],
        torsion_constant=own.torsion_constant * factor[3],
        inertia_z=own.inertia_z * factor[4],
        inertia_y=own.inertia_y * factor[5],
    )
    if not (np.array([factor[0], *factor[3:6]]) > 0.0).all():
        raise row.error("a modifier is zero or negative; write a small one instead")
    pins = np.zeros(12, dtype=np.bool_)
    for name in released:
        pins[_RELEASES[name[:-1]] + (6 if name[-1] == "J" else 0)] = True
    if pins.any():
        tables.changes["frames with released ends"] += 1
    arms = np.zeros((2, 3)) if moved is None else tables.length * moved
    if 1 <= cardinal <= 9:
        up, side = divmod(cardinal - 1, 3)
        width, depth = own.size
        arms = arms - (0.5 * depth * (up - 1) * axes[1] + 0.5 * width * (1 - side) * axes[2])
    if arms.any():
        tables.changes["frames off their line: on rigid arms"] += 1
    if rigid[2] * max(rigid[:2]) > 0.0:
        tables.changes[f"frames with end offsets, rigid by {rigid[2]:g}"] += 1
        reach = rigid[2] * tables.length * np.array(rigid[:2])
        if reach.sum() >= length:
            raise row.error("its end offsets leave nothing of it; shorten them")
        arms = arms + np.outer([reach[0], -reach[1]], axes[0])
    mass = own.area * section.stuff.density * factor[6] * source.elements + load
    mass += own.area * section.weight / GRAVITY * factor[7] * source.self_weight
    tables.line(row, ends, figures, section.stuff, axes[1], pins=pins, arms=arms, line_mass=mass)


def add_area(
    tables: ModelTables,
    row: Row,
    corners: list[int],
    section: AreaSection,
    source: MassSource,
    *,
    modifiers: Sequence[float] = (1.0,) * 10,
    load: float = 0.0,
    in_diaphragm: bool = False,
) -> None:
    """Add an area; a membrane in a rigid diaphragm is mass at its corners alone.

    Args:
        load: what else is mass, kg/m2.
        in_diaphragm: whether all its corners are.
    """
    factor = np.array(section.modifiers) * np.array(modifiers)
    changed = [f"{n} {v:.3g}" for n, v in zip(AREA_MODIFIERS, factor, strict=True) if v != 1.0]
    if changed:
        tables.changes[f"areas with modifiers {', '.join(changed)}"] += 1
    mass = section.thickness * section.stuff.density * factor[8] * source.elements + load
    weight = section.weight * section.thickness + section.more_weight
    mass += weight / GRAVITY * factor[9] * source.self_weight
    mass += section.more_weight / GRAVITY * source.elements
    membrane = not section.bending > 0.0
    if membrane or section.name in tables.said.ignored:
        if not in_diaphragm:
            raise row.error(
                "it has no bending and its corners are in no rigid diaphragm; assign one, or make "
                "it a shell"
            )
        tables.changes["areas without bending in a rigid diaphragm: their mass alone"] += 1
        points = np.array([tables.points[k] for k in corners])
        fan = np.array([[0, k, k + 1] for k in range(1, len(corners) - 1)])
        normals = area_vectors(points[fan])
        sizes = normals @ (normals.sum(axis=0) / max(np.linalg.norm(normals.sum(axis=0)), 1e-300))
        for triangle, size in zip(fan.tolist(), sizes.tolist(), strict=True):
            for k in triangle:
                share = max(mass * size / 3.0, 0.0)
                tables.point_mass(row, corners[k], [share] * 3, np.zeros(3))
        return
    if np.ptp(factor[:3]) > 1e-6 or np.ptp(factor[3:6]) > 1e-6:
        raise row.error(
            "its modifiers differ by direction, and shells here are as stiff in all; give f11, "
            "f22, f12 one value, and m11, m22, m12 another"
        )
    bending = float(factor[3]) * (section.bending / section.thickness) ** 3
    tables.area(
        row,
        corners,
        section.stuff,
        section.thickness,
        bending=bending,
        membrane=float(factor[0]),
        area_mass=mass,
    )
