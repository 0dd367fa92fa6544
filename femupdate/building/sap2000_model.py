"""Reads the text of SAP2000 (.s2k): tables of rows with key=value."""

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.csi_model import (
    GRAVITY,
    MassSource,
    Properties,
    Row,
    add_area,
    add_frame,
    once,
    tell_unread,
    units_of,
)
from femupdate.building.model_tables import ModelFile, ModelTables, file_text, known
from femupdate.errors import BuildingError

_TOKEN = re.compile(r'([^\s=]+)=("[^"]*"|\S*)')
_GENERAL = "FRAME SECTION PROPERTIES 01 - GENERAL"
_MATERIAL = "MATERIAL PROPERTIES 02 - BASIC MECHANICAL PROPERTIES"
_OLD_MATERIAL = "MATERIAL PROPERTIES 01 - GENERAL"  # which holds all in versions 9 and 10
_ACTIVE = "ACTIVE DEGREES OF FREEDOM"
_ADDED = "JOINT ADDED MASS ASSIGNMENTS"
_FRAME_MASS, _AREA_MASS = (f"{kind} ADDED MASS ASSIGNMENTS" for kind in ("FRAME", "AREA"))
_TO_FRAMES = "AREA LOADS - UNIFORM TO FRAME"
_OFFSETS = "FRAME OFFSET ALONG LENGTH ASSIGNMENTS"
_DIAPHRAGMS, _BODIES = (f"CONSTRAINT DEFINITIONS - {kind}" for kind in ("DIAPHRAGM", "BODY"))
_TAKEN = (
    *("JOINT COORDINATES", "JOINT RESTRAINT ASSIGNMENTS", "JOINT CONSTRAINT ASSIGNMENTS"),
    *("CONNECTIVITY - FRAME", "CONNECTIVITY - AREA", "FRAME SECTION ASSIGNMENTS"),
    *("AREA SECTION ASSIGNMENTS", "AREA SECTION PROPERTIES", "COORDINATE SYSTEMS", "MASS SOURCE"),
    *("FRAME RELEASE ASSIGNMENTS 1 - GENERAL", "FRAME PROPERTY MODIFIERS"),
    *("FRAME LOCAL AXES ASSIGNMENTS 1 - TYPICAL", "FRAME INSERTION POINT ASSIGNMENTS"),
    *("AREA STIFFNESS MODIFIERS", "JOINT SPRING ASSIGNMENTS 1 - UNCOUPLED", "PROGRAM CONTROL"),
    *("MASSES 1 - MASS SOURCE", "LOAD PATTERN DEFINITIONS", "JOINT LOADS - FORCE"),
    *("FRAME LOADS - DISTRIBUTED", "FRAME LOADS - POINT", "AREA LOADS - UNIFORM", _TO_FRAMES),
    *(_GENERAL, _MATERIAL, _ADDED, _FRAME_MASS, _AREA_MASS, _OFFSETS, _DIAPHRAGMS, _BODIES),
)
# Families of tables that change the structure, but for those that do not.
_STRUCTURE = (
    *("JOINT", "FRAME", "AREA", "LINK", "CABLE", "TENDON", "SOLID", "CONSTRAINT"),
    *("CONNECTIVITY", "MASSES"),
)
_HARMLESS = re.compile(
    r"(JOINT (LOADS|PATTERN)|FRAME (LOADS|DESIGN|OUTPUT|LOAD TRANSFER|AUTO MESH|P-DELTA|FIREPROOF"
    r"|SECTION PROPERTIES (0[2-9]|1|2))|AREA (LOADS|AUTO MESH|EDGE|DESIGN|LOCAL AXES|SECTION "
    r"PROPERTY DESIGN|SECTION PROPERTIES -)|LINK PROPERTY|SOLID PROPERTY|CABLE SECTION"
    r"|TENDON SECTION|JOINT (GROUPS|MERGE)|CONSTRAINT DEFINITIONS)"
)
_PATTERN = ("LoadPat", "LoadCase")  # the second before version 12
_PARTS = ("P", "V2", "V3", "T", "M2", "M3")
_WAYS = ("U1", "U2", "U3", "R1", "R2", "R3")


@dataclass(frozen=True)
class SapModel(ModelFile[Row]):
    """A file of SAP2000."""

    program: ClassVar[str] = "SAP2000"
    node_kind: ClassVar[str] = "joint"
    what: ClassVar[str] = "rows of"
    mends: ClassVar[Mapping[str, str]] = {
        "CONNECTIVITY - LINK": "replace linear links by joint springs or frames",
        _ACTIVE: "make all six active",
    }

    @classmethod
    def opened(cls, file: Path) -> "SapModel":
        """The tables of a file."""
        tables: dict[str, list[Row]] = defaultdict(list)
        name, words, first = "", "", 0
        for number, line in enumerate(file_text(file).splitlines(), 1):
            head = re.match(r'\s*TABLE:\s*"([^"]+)"', line, re.I)
            if head:
                name = head[1].upper()
                tables[name] = tables[name]
            elif line.strip().upper().startswith("END TABLE DATA"):
                break
            elif name and line.strip():
                first = first or number
                part = line.rstrip()
                words += part.removesuffix("_") + " "
                if part.endswith(" _"):
                    continue
                found = {key.upper(): value.strip('"') for key, value in _TOKEN.findall(words)}
                if not found:
                    raise Row(file.name, name, number, {}).error(
                        f"{line.strip()!r} has no key=value; export the tables again"
                    )
                tables[name].append(Row(file.name, name, first, found))
                words, first = "", 0
        else:
            raise BuildingError(f"{file.name}: it ends without END TABLE DATA; export it again")
        if not tables.get("JOINT COORDINATES"):
            raise BuildingError(
                f"{file.name}: it has no table JOINT COORDINATES; export the model definition as "
                "text (.s2k)"
            )
        return cls(file, dict(tables))

    @property
    def units(self) -> tuple[str, str]:
        """Those of PROGRAM CONTROL."""
        stated = {row.text("CurrUnits") for row in self.of("PROGRAM CONTROL")} - {""}
        if len(stated) != 1:
            said = " and ".join(sorted(stated)) or "none"
            raise BuildingError(
                f"{self.file.name}: PROGRAM CONTROL names the units {said}; export the tables in "
                'one, such as CurrUnits="KN, m, C"'
            )
        return units_of(self.file.name, stated.pop().split(","))

    @property
    def left_out(self) -> Mapping[str, int]:
        """Tables that modes do not depend on."""
        return {n: k for n, k in self.counts.items() if n not in (*_TAKEN, *self.unknown)}

    @cached_property
    def unknown(self) -> list[str]:
        """Tables that change the structure and have no counterpart."""
        assigned = {row.text("Constraint") for row in self.of("JOINT CONSTRAINT ASSIGNMENTS")}
        found = []
        for name in self.counts:
            kind = name.startswith(_STRUCTURE) and name not in _TAKEN
            used = {row.text("Name") for row in self.of(name)} & assigned
            if kind and (not _HARMLESS.match(name) or (name.startswith("CONSTRAINT") and used)):
                found.append(name)
        active = [way for row in self.of(_ACTIVE) for way in row.values.values()]
        return [*found, _ACTIVE] if "no" in map(str.lower, active) else found

    def fill(self, tables: ModelTables) -> None:
        """Fill the tables."""
        for key, kind in (("Frame", "FRAME"), ("Area", "AREA")):  # no assignment is lost
            there = {row.text(key) for row in self.of(f"CONNECTIVITY - {kind}")}
            for row in self.of(*(name for name in _TAKEN if name.startswith(kind))):
                known(row, dict.fromkeys({*there, ""}), row.text(key), kind.lower())
        reading = _SapReading(self, tables)
        reading.joints()
        reading.restraints()
        reading.frames()
        reading.areas()
        tables.divide_lines()
        tell_unread(tables, self.of(*_TAKEN), _HARMLESS_KEYS)


_HARMLESS_KEYS = re.compile(
    r"A1?|ADVANCEAXES|ARC|AREA(AREA|TYPE)|AUTOSELECT|AXIS|BENDTHICK|CENTROID.|CG.*|\w+CODE|COLOR"
    r"|CONC(BEAM|COL)|COORD\w+|CURRUNITS|CW|DES\w+|DISTTYPE|DRILLDOF|ECC\w+|FILLETRADIUS|FROMFILE"
    r"|GUID|GLOBAL.|IS(CURVED|DEFAULT)|LENGTH|LICENSE\w*|LOADS|MATANGLE|MDAMPRATIO|MIRROR.|NOTES"
    r"|PARTIALFIX|PERIMETER|PNA\w*|PROG\w+|REGENHINGE|[RSZ]\d\d\w*|SCOFFSET.*|SECTIONTYPE|SHAPE"
    r"|SPECIALJT|SYMTYPE|TEMPDEPEND|TOTAL\w+|TYPE|VERSION"
)


class _SapReading:
    """The tables of a file, read one kind after the other."""

    def __init__(self, file: SapModel, tables: ModelTables) -> None:
        self.file, self.tables = file, tables
        self.source = self._mass_source()
        self.properties = Properties(
            tables,
            once(file.of(_MATERIAL) or file.of(_OLD_MATERIAL), "Material"),
            once(file.of(_GENERAL), "SectionName"),
            once(file.of("AREA SECTION PROPERTIES"), "Section"),
        )
        self.in_diaphragm: set[int] = set()

    def _mass_source(self) -> MassSource:
        source = MassSource()
        old, new = self.file.of("MASSES 1 - MASS SOURCE"), self.file.of("MASS SOURCE")
        name = next((r.text("MassSource") for r in new if r.flag("IsDefault")), "")
        rows = [r for r in new if r.text("MassSource") in ("", name)] if name else new
        for row in rows[:1]:
            source.elements, source.added = row.flag("Elements", True), row.flag("Masses", True)
        for row in old:
            if said := row.text("MassFrom").lower():
                source.elements = source.added = "element" in said
        weights = {
            r.text(*_PATTERN): r.real("SelfWtMult", usual=0.0)
            for r in self.file.of("LOAD PATTERN DEFINITIONS", "LOAD CASE DEFINITIONS")
        }
        for row in [*rows, *old]:
            if pattern := row.text(*_PATTERN):
                source.add(row, pattern, row.real("Multiplier", usual=1.0), weights)
        return source.told(self.tables)

    def _axes(self, row: Row) -> tuple[Floats, Floats]:
        """Origin and axes, as rows, of the system that a row names."""
        name = row.text("CoordSys").upper()
        if name in ("", "GLOBAL"):
            return np.zeros(3), np.eye(3)
        systems = {r.text("Name").upper(): r for r in self.file.of("COORDINATE SYSTEMS")}
        entry = known(row, systems, name, "system")
        axes = np.eye(3)
        for key, (a, b) in (("AboutX", (1, 2)), ("AboutY", (2, 0)), ("AboutZ", (0, 1))):
            turn = np.deg2rad(entry.real(key, usual=0.0))
            spin = np.eye(3)
            spin[[a, b], [a, b]], spin[a, b], spin[b, a] = np.cos(turn), np.sin(turn), -np.sin(turn)
            axes = axes @ spin
        return np.array([entry.real(key, usual=0.0) for key in "XYZ"]), axes

    def joint(self, row: Row, key: str = "Joint") -> int:
        return self.tables.find(row, row.named(key))

    def joints(self) -> None:
        for name, row in once(self.file.of("JOINT COORDINATES"), "Joint").items():
            origin, axes = self._axes(row)
            point = np.array([row.real("XorR", "GlobalX"), 0.0, row.real("Z", "GlobalZ")])
            if row.text("CoordType").lower().startswith("cyl"):
                turn = np.deg2rad(row.real("T"))
                point[:2] = point[0] * np.array([np.cos(turn), np.sin(turn)])
            else:
                point[1] = row.real("Y", "GlobalY")
            self.tables.node(name, origin + point @ axes)

    def restraints(self) -> None:
        tables = self.tables
        for row in self.file.of("JOINT RESTRAINT ASSIGNMENTS"):
            held = [k for k, way in enumerate(_WAYS) if row.flag(way)]
            tables.holds.append((self.joint(row), held))
        for row in self.file.of("JOINT SPRING ASSIGNMENTS 1 - UNCOUPLED"):
            if row.text("CoordSys").upper() not in ("", "GLOBAL", "LOCAL"):
                raise row.error("springs along other axes are not modelled; give global ones")
            for k, way in enumerate(_WAYS):
                if row.real(way, usual=0.0):
                    tables.spring(self.joint(row), -1, k, row.real(way))
        members: dict[str, list[int]] = defaultdict(list)
        every = self.file.of(*(kind for kind in self.file.entries if kind.startswith("CONSTRAINT")))
        defined = dict.fromkeys(row.text("Name") for row in every)
        for row in self.file.of("JOINT CONSTRAINT ASSIGNMENTS"):
            known(row, defined, row.named("Constraint"), "constraint")
            members[row.text("Constraint")].append(self.joint(row))
        for row in self.file.of(_DIAPHRAGMS):
            nodes = members.pop(row.named("Name"), [])
            levels = np.array([tables.points[k][2] for k in nodes]).round(3)
            if row.text("Axis").upper() not in ("", "Z", "AUTO"):
                raise row.error("only diaphragms about Z are modelled; correct its axis")
            for level in np.unique(levels):
                body = np.array(nodes)[(levels == level) | (not row.flag("MultiLevel"))]
                tables.bodies.append(body)
                self.in_diaphragm.update(body.tolist())
        for row in self.file.of(_BODIES):
            nodes = members.pop(row.named("Name"), [])
            tied = np.array([row.flag(k, True) for k in ("UX", "UY", "UZ", "RX", "RY", "RZ")])
            for node in nodes[1:]:
                tables.tie(row, nodes[0], node, tied)
        for row in self.file.of(_ADDED) if self.source.added else []:
            values = [row.real(key, f"{other}", usual=0.0) for key, other in _MASS_KEYS]
            mass = np.array(values[:3]) * tables.mass
            inertia = np.array(values[3:]) * tables.mass * tables.length**2
            tables.point_mass(row, self.joint(row), mass, inertia)
        for row in self.file.of("JOINT LOADS - FORCE"):
            self._weigh(row, self.joint(row), -row.real("F3", usual=0.0) * self._share(row))

    def _weigh(self, row: Row, node: int, weight: float) -> None:
        """Add the mass of a weight, in the file's unit of force."""
        if weight > 0.0:
            kg = weight * self.tables.force / GRAVITY
            self.tables.point_mass(row, node, [kg] * 3, np.zeros(3))

    def _share(self, row: Row) -> float:
        return self.source.patterns.get(row.text(*_PATTERN), 0.0)

    def frames(self) -> None:
        file, tables = self.file, self.tables
        assigned, angles, releases, offsets, points, changes = (
            once(file.of(name), "Frame")
            for name in (
                "FRAME SECTION ASSIGNMENTS",
                "FRAME LOCAL AXES ASSIGNMENTS 1 - TYPICAL",
                "FRAME RELEASE ASSIGNMENTS 1 - GENERAL",
                _OFFSETS,
                "FRAME INSERTION POINT ASSIGNMENTS",
                "FRAME PROPERTY MODIFIERS",
            )
        )
        lines = once(file.of("CONNECTIVITY - FRAME"), "Frame")
        loads: dict[str, float] = defaultdict(float)
        for row in file.of("FRAME LOADS - DISTRIBUTED"):
            loads[row.text("Frame")] += self._load(row, "FOverLA", "FOverLB")
        for row in file.of("FRAME LOADS - POINT"):
            line = known(row, lines, row.named("Frame"), "frame")
            share = row.real("RelDist")
            for key, part in (("JointI", 1.0 - share), ("JointJ", share)):
                self._weigh(row, self.joint(line, key), part * self._load(row, "Force", "Force"))
        for row in file.of(_FRAME_MASS) if self.source.added else []:
            mass = row.real("MassPerLen", "MassPerLength")
            loads[row.text("Frame")] += mass * GRAVITY / tables.length
        for name, row in lines.items():
            if row.flag("IsCurved"):
                raise row.error("a curved frame has no counterpart; divide it into straight ones")
            none = Row(row.file, row.table, row.line, {})
            release, offset, point = (rows.get(name, none) for rows in (releases, offsets, points))
            moved, cardinal = None, 10
            if point.values and point.flag("Transform", point.flag("StiffTransform", True)):
                # The number may come with its words: "8 (top center)".
                cardinal = int(point.text("CardinalPt").partition(" ")[0] or 10)
                moved = np.array(
                    [[point.real(f"JtOffset{a}{e}", usual=0.0) for a in "XYZ"] for e in "IJ"]
                )
            add_frame(
                tables,
                row,
                [self.joint(row, key) for key in ("JointI", "JointJ")],
                self.properties,
                (given := assigned.get(name, row)).named("AnalSect"),
                self.source,
                material=given.text("MatProp"),
                angle=angles.get(name, none).real("Angle", usual=0.0),
                released=[f"{p}{e}" for p in _PARTS for e in "IJ" if release.flag(f"{p}{e}")],
                rigid=[offset.real(k, usual=0.0) for k in ("LengthI", "LengthJ", "RigidFactor")],
                cardinal=cardinal,
                moved=moved,
                changes=changes.get(name),
                load=loads[name] * tables.force / tables.length / GRAVITY,
            )

    def areas(self) -> None:
        file, tables = self.file, self.tables
        assigned, changes = (
            once(file.of(table), "Area")
            for table in ("AREA SECTION ASSIGNMENTS", "AREA STIFFNESS MODIFIERS")
        )
        loads: dict[str, float] = defaultdict(float)
        for row in file.of("AREA LOADS - UNIFORM", _TO_FRAMES):
            loads[row.text("Area")] += self._load(row, "UnifLoad", "UnifLoad")
        for row in file.of(_AREA_MASS) if self.source.added else []:
            loads[row.text("Area")] += row.real("MassPerArea") * GRAVITY / tables.length
        for name, row in once(file.of("CONNECTIVITY - AREA"), "Area").items():
            corners = [self.joint(row, f"Joint{k + 1}") for k in range(int(row.real("NumJoints")))]
            add_area(
                tables,
                row,
                corners,
                self.properties,
                (given := assigned.get(name, row)).named("Section"),
                self.source,
                material=given.text("MatProp"),
                changes=changes.get(name),
                load=loads[name] * tables.force / tables.length**2 / GRAVITY,
                in_diaphragm=self.in_diaphragm.issuperset(corners),
            )

    def _load(self, row: Row, first: str, last: str) -> float:
        """Mean load downwards on all of a frame or area that is mass, in the file's units."""
        share = self._share(row)
        mean = 0.5 * share * (row.real(first, usual=0.0) + row.real(last, usual=0.0))
        part = row.real("RelDistB", usual=1.0) - row.real("RelDistA", usual=0.0)
        if share and part != 1.0:
            self.tables.changes["loads on a part of a frame: spread over all of it"] += 1
        way = row.text("Dir").lower()
        return part * (mean if "grav" in way else -mean if way == "z" else 0.0)


_MASS_KEYS = tuple(
    (f"{name}{k + 1}", _WAYS[k + 3 * (name == "MMI")]) for name in ("Mass", "MMI") for k in range(3)
)
