"""What SAP2000 and ETABS share: rows of text, local axes, modifiers, insertion, mass sources."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.deck_model import SHAPES
from femupdate.building.entry import ALL
from femupdate.building.model_tables import ModelTables, Stuff, known
from femupdate.building.sections import SectionFigures
from femupdate.errors import BuildingError
from femupdate.fe.model import area_vectors

FORCES = {"n": "N", "kn": "kN", "kgf": "kgf", "tonf": "tf", "lb": "lbf", "kip": "kip"}
LENGTHS = ("m", "cm", "mm", "in", "ft")
FRAME_MODIFIERS = ("A", "AS2", "AS3", "J", "I22", "I33", "M", "W")
AREA_MODIFIERS = ("F11", "F22", "F12", "M11", "M22", "M12", "V13", "V23", "M", "W")
# How else they are called.
_ALSO = {"A": "AREA", "AS2": "A2", "AS3": "A3", "J": "T", "I22": "I2", "I33": "I3"} | {
    "M": "MASS",
    "W": "WEIGHT",
}
_LEAST = 1e-4  # share of a stiffness whose modifier is 0
_BY_DIRECTION = "modifiers by direction"  # what mesh.ignore takes at its mean
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
    values: Mapping[str, str]  # by their keys in capitals
    read: set[str] = field(default_factory=set)  # keys that were asked for

    def error(self, text: str) -> BuildingError:
        """A complaint about this row, with its file and line."""
        name = next(iter(self.values.values()), "")
        return BuildingError(f"{self.file}, line {self.line}: {self.table} {name}: {text}")

    def text(self, *keys: str) -> str:
        """The first of these keys that is there; empty without one."""
        names = [key.upper() for key in keys]
        self.read.update(names)
        return next((self.values[name] for name in names if name in self.values), "")

    def named(self, *keys: str) -> str:
        """As `text`, of what must be there."""
        text = self.text(*keys)
        if not text:
            raise self.error(f"{keys[0]} is missing; export the table again with it")
        return text

    def flag(self, key: str, usual: bool = False) -> bool:
        """Yes or no."""
        text = self.text(key).lower()
        if text not in (*_NO, "yes", "true", "1"):
            raise self.error(f"{key} is {text!r}; write Yes or No")
        return usual if not text else text not in _NO

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
            name = next((key for key in keys if key.upper() in self.values), keys[0])
            raise self.error(f"{name} {said}; write a number")
        return value


def tell_unread(tables: ModelTables, rows: Iterable[Row], harmless: re.Pattern[str]) -> None:
    """List the keys of each table that nothing reads."""
    found: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        found[row.table].append(row)
    for table, some in found.items():
        unread = set().union(*(row.values for row in some)).difference(*(row.read for row in some))
        for key in sorted(key for key in unread if not harmless.fullmatch(key)):
            tables.skipped[f"key {key} of {table}"] += sum(key in row.values for row in some)


def units_of(file: str, words: Iterable[str]) -> tuple[str, str]:
    """Units of force and length from the words of a file; BuildingError for unknown ones."""
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

    def add(self, row: Row, pattern: str, share: float, weights: Mapping[str, float]) -> None:
        """Add a share of a load pattern; weights say how often the self weight is in each."""
        self.self_weight += share * known(row, weights, pattern, "load pattern")
        self.patterns[pattern] = self.patterns.get(pattern, 0.0) + share

    def told(self, tables: ModelTables) -> "MassSource":
        """List what it takes of loads among the changes."""
        if self.patterns:
            listed = ", ".join(f"{share:g} {name}" for name, share in self.patterns.items())
            tables.changes[f"mass source: loads {listed} over g"] += 1
        return self


def modifiers(row: Row, names: Sequence[str]) -> tuple[float, ...]:
    """Modifiers of an assignment or a section, in any of their spellings."""
    if several := row.text("PROPMODIFIERS").split():
        row = replace(row, values=dict(zip(names, several, strict=False)))
    found = []
    for name in names:
        spelt = (name, _ALSO.get(name, name))
        keys = [f"{start}{n}{end}" for n in spelt for start, end in _ENDS]
        plain = [name] if several or (names is AREA_MODIFIERS and name not in "MW") else []
        found.append(row.real(*keys, *plain, usual=1.0))
    return tuple(found)


_ENDS = (("", "MOD"), ("", "MODIFIER"), ("PROPMOD", ""))


def _modified(
    tables: ModelTables, of_section: Sequence[float], changes: Row | None, names: Sequence[str]
) -> Floats:
    """Modifiers of a member: those of its section times those assigned to it, which are noted."""
    factor = np.array(of_section) * (1.0 if changes is None else modifiers(changes, names))
    changed = [f"{n} {v:.3g}" for n, v in zip(names, factor, strict=True) if v != 1.0]
    if changed:
        kind = "frames" if names is FRAME_MODIFIERS else "areas"
        tables.changes[f"{kind} with modifiers {', '.join(changed)}"] += 1
    return factor


class Properties:
    """Materials and sections by their name, which are read when they are used."""

    def __init__(
        self,
        tables: ModelTables,
        materials: Mapping[str, Row],
        frames: Mapping[str, Row],
        areas: Mapping[str, Row],
    ) -> None:
        """Keep the rows of each."""
        self.tables, self._rows = tables, (materials, frames, areas)
        self._frame_of, self._area_of = cache(self._frame), cache(self._area)

    def frame(self, user: Row, name: str, material: str = "") -> FrameSection:
        """The section of a frame, of another material where it is named."""
        known(user, self._rows[1], name, "section")
        return self._frame_of(name, material)

    def area(self, user: Row, name: str, material: str = "") -> AreaSection:
        """The section of an area, likewise."""
        known(user, self._rows[2], name, "section")
        return self._area_of(name, material)

    def _material(self, row: Row, named: str) -> tuple[Stuff, float]:
        """A material, and its weight, N/m3."""
        tables = self.tables
        if named.lower() in ("", "default", "none"):
            named = row.named("MATERIAL", "CONCMATERIAL")
        entry = known(row, self._rows[0], named, "material")
        young, shear = entry.real("E", "E1"), entry.real("G12", usual=0.0)
        if {young} != {entry.real(key, usual=young) for key in ("E2", "E3")}:
            raise entry.error("it differs by direction, which nothing here does; make it isotropic")
        ratio = entry.real("U", "U12", usual=0.5 * young / shear - 1.0 if shear else 0.2)
        weight = entry.real("WEIGHTPERVOLUME", "UnitWeight", "W", usual=0.0)
        usual = weight * tables.length / GRAVITY
        density = entry.real("MASSPERVOLUME", "UnitMass", "M", usual=usual)
        stuff = tables.material(entry, young, ratio, density, shear)
        return stuff, weight * tables.force / tables.length**3

    def _frame(self, name: str, material: str) -> FrameSection:
        row = self._rows[1][name]
        stuff = self._material(row, material)
        return FrameSection(self._figures(row, name), *stuff, modifiers(row, FRAME_MODIFIERS))

    def _figures(self, row: Row, name: str) -> SectionFigures:
        """Figures of a frame's section as they are given, or as its sides make them."""
        tables = self.tables
        keys = (("D", "t3"), ("B", "t2"), ("TF", "T"), ("TW", "T"))
        d, b, flange, web = (tables.length * row.real(*names, usual=0.0) for names in keys)
        shape = row.text("SHAPE")
        if row.text("AREA"):
            if row.real("I23", usual=0.0):
                raise row.error("I23 couples both ways of bending; give principal axes")
            names = (("I33",), ("I22",), ("J", "TorsConst"), ("AS2",), ("AS3",))
            i33, i22, torsion, *shear = (row.real(*keys_of, usual=0.0) for keys_of in names)
            return tables.section(row, row.real("AREA"), (i33, i22), torsion, shear)
        words = shape.lower()
        shapes = {
            "rectangular": ("BAR", (b, d)),
            "plate": ("BAR", (b, d)),
            "circle": ("ROD", (d / 2.0,)),
            "rod": ("ROD", (d / 2.0,)),
            "pipe": ("TUBE", (d / 2.0, d / 2.0 - (web or flange))),
            "tube": ("BOX", (b, d, flange, web)),
            "wide flange": ("I", (d, b, b, web, flange, flange)),
            "channel": ("CHAN", (b, d, web, flange)),
            "tee": ("T", (b, d, flange, web)),
        }
        fitting = next((word for word in shapes if word in words), None)
        if fitting is None or not d > 0.0 or re.search("fill|encase|double", words):
            given = tables.said.sections.get(name)
            if given is not None or tables.said.ignored == ALL:  # a draft asks for it
                return given or SHAPES["BAR"][1](0.3, 0.3)
            raise row.error(
                f"its shape {shape!r} is not known, or its sides are missing; give its "
                f"figures (General), its sides, or [sections.{json.dumps(name)}] in a building file"
            )
        kind, sides = shapes[fitting]
        try:
            return SHAPES[kind][1](*sides)
        except ValueError:
            raise row.error(f"its sides make no {shape}; correct them") from None

    def _area(self, name: str, material: str) -> AreaSection:
        tables, row = self.tables, self._rows[2][name]
        stuff, weight = self._material(row, material)
        keys = ("THICKNESS", "SLABTHICKNESS", "WALLTHICKNESS", "TM", "DECKSLABDEPTH")
        thick, more = row.real(*keys), 0.0
        kind = row.text("MODELINGTYPE", "TYPE").lower()
        if "deck" in f"{row.text('PROPTYPE')} {kind}".lower():
            wide = [row.real(f"DECKRIBWIDTH{side}", usual=0.0) for side in ("TOP", "BOTTOM")]
            ribs = row.real("DECKRIBDEPTH", usual=0.0) * 0.5 * sum(wide)
            thick += ribs / row.real("DECKRIBSPACING", usual=1.0)
            more = row.real("DECKUNITWEIGHT", usual=0.0) * tables.force / tables.length**2
            kind = "membrane"
        plane = row.text("AREATYPE").lower() not in ("", "shell")
        ribbed = row.text("SLABTYPE").lower() not in ("", "slab", "uniform", "drop", "stiff", "mat")
        if "layer" in kind or "plate" in kind or plane or ribbed:
            raise row.error(
                "layers, ribs, plates and plane areas have no counterpart; use a shell of one "
                "thickness"
            )
        if not thick > 0.0:
            raise row.error("its thickness must be positive; correct it")
        bending = 0.0 if "membrane" in kind else row.real("BENDTHICK", "TB", usual=thick)
        sizes = thick * tables.length, bending * tables.length
        return AreaSection(stuff, weight, *sizes, modifiers(row, AREA_MODIFIERS), more)


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
    properties: Properties,
    name: str,
    source: MassSource,
    *,
    angle: float = 0.0,
    released: Iterable[str] = (),
    rigid: Sequence[float] = (0.0, 0.0, 0.0),
    cardinal: int = 10,
    moved: Floats | None = None,
    changes: Row | None = None,
    load: float = 0.0,
    material: str = "",
) -> None:
    """Add a frame with all that is assigned to it, or nothing where its section is none.

    Args:
        name: of its section.
        released: such as "M3I".
        rigid: lengths of its end offsets in the file's unit, and the share that is rigid.
        cardinal: point of the section that lies on the line, 10 for the centroid.
        moved: (2, 3) offsets of its ends in global axes, in the file's unit.
        changes: where its modifiers stand.
        load: what else is mass, kg/m.
        material: in place of the section's.
    """
    if name.upper() in ("", "NONE"):
        tables.skipped[f"{row.table} without a section"] += 1
        return
    section = properties.frame(row, name, material)
    span = tables.points[ends[1]] - tables.points[ends[0]]
    length = float(np.linalg.norm(span))
    if not length > 0.0:
        raise row.error("it has no length; move a joint or remove it")
    axes = local_axes(span, angle)
    factor = _modified(tables, section.modifiers, changes, FRAME_MODIFIERS)
    own = section.figures
    if (factor < 0.0).any():
        raise row.error("a modifier is negative; correct it")
    factor[[0, 3, 4, 5]] = np.maximum(factor[[0, 3, 4, 5]], _LEAST)  # 0 leaves a mechanism
    figures = replace(
        own,
        area=own.area * factor[0],
        shear_area_z=own.shear_area_z * factor[1] if factor[1] else np.inf,
        shear_area_y=own.shear_area_y * factor[2] if factor[2] else np.inf,
        torsion_constant=own.torsion_constant * factor[3],
        inertia_z=own.inertia_z * factor[4],
        inertia_y=own.inertia_y * factor[5],
    )
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
    properties: Properties,
    name: str,
    source: MassSource,
    *,
    changes: Row | None = None,
    load: float = 0.0,
    in_diaphragm: bool = False,
    material: str = "",
) -> None:
    """Add an area; a membrane in a rigid diaphragm is mass at its corners alone.

    Args:
        name: of its section; without one it is its load alone.
        changes: where its modifiers stand.
        load: what else is mass, kg/m2.
    """
    if name.upper() in ("", "NONE", "NULL"):  # an opening, or an area for loads
        tables.skipped[f"{row.table} without a section"] += 1
        _corner_mass(tables, row, corners, load)
        return
    section = properties.area(row, name, material)
    factor = _modified(tables, section.modifiers, changes, AREA_MODIFIERS)
    mass = section.thickness * section.stuff.density * factor[8] * source.elements + load
    weight = section.weight * section.thickness + section.more_weight
    mass += weight / GRAVITY * factor[9] * source.self_weight
    mass += section.more_weight / GRAVITY * source.elements
    if not section.bending > 0.0:
        if not in_diaphragm:
            raise row.error(
                "it has no bending and its corners are in no rigid diaphragm; assign one, or make "
                "it a shell"
            )
        tables.changes["areas without bending in a rigid diaphragm: their mass alone"] += 1
        _corner_mass(tables, row, corners, mass)
        return
    if np.ptp(factor[:3]) > 1e-6 or np.ptp(factor[3:6]) > 1e-6:
        if tables.said.ignored != ALL and _BY_DIRECTION not in tables.said.ignored:
            raise row.error(
                "its modifiers differ by direction, and shells here are as stiff in all; give f11, "
                "f22, f12 one value, and m11, m22, m12 another, or take their means by "
                f'mesh.ignore = ["{_BY_DIRECTION}"] in a building file'
            )
        tables.changes["areas whose modifiers differ by direction: at their mean"] += 1
        factor[:3], factor[3:6] = factor[:3].mean(), factor[3:6].mean()
    factor[:6] = np.maximum(factor[:6], _LEAST)
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


def _corner_mass(tables: ModelTables, row: Row, corners: list[int], mass: float) -> None:
    """Put the mass of an area, kg/m2, at its corners."""
    if (count := len(set(corners))) < max(3, len(corners)):
        raise row.error(f"it has {count} corners; give it three or more, each once")
    points = np.array([tables.points[k] for k in corners])
    fan = np.array([[0, k, k + 1] for k in range(1, len(corners) - 1)])
    normals = area_vectors(points[fan])
    sizes = normals @ (normals.sum(axis=0) / max(np.linalg.norm(normals.sum(axis=0)), 1e-300))
    for triangle, size in zip(fan.tolist(), sizes.tolist(), strict=True) if mass else ():
        for k in triangle:
            share = max(mass * size / 3.0, 0.0)
            tables.point_mass(row, corners[k], [share] * 3, np.zeros(3))
