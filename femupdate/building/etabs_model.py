"""Reads the text of ETABS (.e2k, .$et): points in plan, stories, and what is assigned to them."""

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np

from femupdate.arrays import Flags, Floats
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

# How many values stand before the pairs of key and value, of what is taken.
_ONE = "STORY DIAPHRAGM MATERIAL FRAMESECTION SHELLPROP MASSSOURCE LOADPATTERN LOADCASE"
_TWO = "POINTASSIGN LINEASSIGN AREAASSIGN LINELOAD AREALOAD POINTLOAD"
_PLACES = dict.fromkeys(_ONE.split(), 1) | dict.fromkeys(_TWO.split(), 2)
_PLACES |= {"UNITS": 3, "POINT": 4, "LINE": 5, "AREA": 99, "MASSSOURCELOAD": 3, "MASSOPTIONS": 0}
_MERGED = ("MATERIAL", "FRAMESECTION", "SHELLPROP", "LINEASSIGN", "AREAASSIGN")
# Lines that change the structure, unless they are taken.
_REFUSED = re.compile(
    r"\w*(ASSIGN|HINGE|MASS|SPRING)|LINK|TENDON|CURVE\w*|REFERENCEPOINT|ACTIVEDOF"
)
_WAYS = ("UX", "UY", "UZ", "RX", "RY", "RZ")
_RELEASED = tuple(f"{part}{end}" for end in "IJ" for part in ("P", "V2", "V3", "T", "M2", "M3"))
_HARMLESS = re.compile(
    r"(GUID|NOTES|COLOR|SYMTYPE|TYPE|GRADE|A|F[YUC].*|SIMILARTO|MASTERSTORY|SPLICE.*|M[AI][XN].*"
    r"|AUTOMESH|MESH.*|OBJMESH.*|ADDRESTRAINT|PIER|SPANDREL|DESIGN.*|TRANSFORM.*|[1-9]|TITLE.*"
    r"|HYSTYPE|SSTYPE|STRAINAT.*|FINALSLOPE|(IO|LS|CP)[TC].*|ENERGYDEGFACT|TIMEDEP.*"
    r"|PROPTYPE|MODELINGTYPE|SLABTYPE|IS.*|LUMP.*|INCLUDE.*|PREFERENCE|CARDINALPOINT|COVER.*)"
)


@dataclass(frozen=True)
class EtabsModel(ModelFile[Row]):
    """A file of ETABS."""

    program: ClassVar[str] = "ETABS"
    node_kind: ClassVar[str] = "point"
    what: ClassVar[str] = "lines"
    mends: ClassVar[Mapping[str, str]] = {"LINK": "replace linear links by frames"}

    @classmethod
    def opened(cls, file: Path) -> "EtabsModel":
        """The lines of a file."""
        rows: dict[str, list[Row]] = defaultdict(list)
        text = file_text(file).partition("STARTCOMMENTS")[0]
        for number, line in enumerate(text.splitlines(), 1):
            words = re.findall(r'"[^"]*"|\S+', line)
            if not words or words[0].startswith("$"):
                continue
            head, words = words[0].upper(), [word.strip('"') for word in words[1:]]
            places = _PLACES.get(head, 1)
            values = {str(k + 1): word for k, word in enumerate(words[:places])}
            rest = words[places:]
            values |= {k.upper(): v for k, v in zip(rest[::2], rest[1::2], strict=False)}
            rows[head].append(Row(file.name, head, number, values))
        if not rows.get("STORY") or not rows.get("POINT"):
            raise BuildingError(
                f"{file.name}: it has no STORY or no POINT; export the model as text (.e2k)"
            )
        return cls(file, dict(rows))

    @property
    def units(self) -> tuple[str, str]:
        """Those of CONTROLS."""
        stated = {(row.text("1"), row.text("2")) for row in self.of("UNITS")}
        if len(stated) != 1:
            said = "two systems of units" if stated else "no UNITS"
            raise BuildingError(f"{self.file.name}: it has {said}; export it in one")
        return units_of(self.file.name, stated.pop())

    @property
    def left_out(self) -> Mapping[str, int]:
        """What modes do not depend on."""
        taken = {*_PLACES, *self.unknown} - {"LOADCASE"}
        return {name: count for name, count in self.counts.items() if name not in taken}

    @cached_property
    def unsized(self) -> list[str]:
        rows = self.merged["FRAMESECTION"]
        used = dict.fromkeys(row.text("SECTION") for row in self.of("LINEASSIGN"))
        return [name for name in used if name in rows and not rows[name].text("D", "AREA")]

    @property
    def unknown(self) -> list[str]:
        """What changes the structure and has no counterpart."""
        whole = all(set(row.text("1").split()) >= {*_WAYS} for row in self.of("ACTIVEDOF"))
        harmless = (*_PLACES, *["ACTIVEDOF"] * whole)
        return [name for name in self.counts if _REFUSED.fullmatch(name) and name not in harmless]

    @cached_property
    def merged(self) -> dict[str, dict[str, Row]]:
        """Materials, sections and assignments, which stand on several lines each."""
        found: dict[str, dict[str, Row]] = {}
        for kind in _MERGED:
            whole = found[kind] = {}
            for row in self.of(kind):
                name = " ".join(map(row.named, "12" if kind.endswith("ASSIGN") else "1"))
                values = {**whole[name].values, **row.values} if name in whole else row.values
                whole[name] = Row(row.file, row.table, row.line, values)
        return found

    def fill(self, tables: ModelTables) -> None:
        """Fill the tables."""
        if "$ END OF MODEL" not in file_text(self.file).upper():
            tables.skipped["END OF MODEL FILE, without which a part may be lost"] += 1
        reading = _EtabsReading(self, tables)
        reading.points()
        reading.lines()
        reading.areas()
        tables.divide_lines()
        rows = [*(row for kind in self.merged.values() for row in kind.values())]
        left = [name for name in _PLACES if name not in (*_MERGED, "LOADCASE")]
        rows += self.of(*left)
        tell_unread(tables, rows, _HARMLESS)


class _EtabsReading:
    """The lines of a file, read one kind after the other."""

    def __init__(self, file: EtabsModel, tables: ModelTables) -> None:
        self.file, self.tables = file, tables
        self.stories = list(once(file.of("STORY"), "1"))[::-1]  # from the base upwards
        self.level: dict[str, float] = {}
        z = 0.0
        for name, row in zip(self.stories, file.of("STORY")[::-1], strict=True):
            optional = not self.level or row.text("ELEV")  # for a base, or with a level
            if (height := row.real("HEIGHT", usual=0.0 if optional else None)) < 0.0:
                raise row.error(f"HEIGHT {height:g} is negative; write it from the floor below")
            z = row.real("ELEV", usual=z + height)
            self.level[name] = z
        tables.levels = {n: tables.length * z for n, z in list(self.level.items())[1:]}
        self.plan = once(file.of("POINT"), "1")
        self.diaphragms = once(file.of("DIAPHRAGM"), "1")
        kinds = {name: row.text("TYPE").upper() for name, row in self.diaphragms.items()}
        self.rigid = {name for name, kind in kinds.items() if kind in ("RIGID", "")}
        self.bodies: dict[tuple[str, str], set[int]] = defaultdict(set)
        self.loose: set[int] = set()  # points that are in no diaphragm
        self.source = self._mass_source()
        self.properties = Properties(tables, *(file.merged[kind] for kind in _MERGED[:3]))

    def _mass_source(self) -> MassSource:
        source, weights = MassSource(), {}
        for row in self.file.of("LOADCASE", "LOADPATTERN"):  # the first in version 9
            weights[row.text("1")] = row.real("SELFWEIGHT", usual=0.0)
        for row in self.file.of("MASSOPTIONS"):
            if name := row.text("LOAD"):
                source.add(row, name, row.real("FACTOR"), weights)
            elif row.text("SOURCE").upper() == "LOADS":
                source.elements = False
        rows = self.file.of("MASSSOURCE")
        for row in [row for row in rows if row.flag("ISDEFAULT")] or rows[:1]:
            source.elements = row.flag("INCLUDEELEMENTS", True)
            if not row.flag("INCLUDEVERTICALMASS", True):
                self.tables.changes["mass source: lateral in ETABS, here in all directions"] += 1
            if row.flag("LUMPATSTORIES"):
                self.tables.changes["mass source: at stories in ETABS, here where it is"] += 1
            loads = row.flag("INCLUDELOADS", True)
            for load in self.file.of("MASSSOURCELOAD") if loads else []:
                if load.text("1") == row.text("1"):
                    source.add(load, load.text("2"), load.real("3"), weights)
        return source.told(self.tables)

    def node(self, row: Row, point: str, story: str, below: int = 0) -> int:
        """The node of a point some stories below one."""
        known(row, self.level, story, "STORY")
        point_entry = known(row, self.plan, point, "POINT")
        place = self.stories.index(story) - below
        if place < 0:
            raise row.error(f"it reaches below {self.stories[0]}; correct its number of stories")
        name = f"{point} on {self.stories[place]}"
        if name not in self.tables.number:
            z = self.level[self.stories[place]] - point_entry.real("4", usual=0.0)
            self.tables.node(name, np.array([point_entry.real("2"), point_entry.real("3"), z]))
        return self.tables.number[name]

    def points(self) -> None:
        for row in self.file.of("POINTASSIGN"):
            node = self.node(row, row.named("1"), row.named("2"))
            held = row.text("RESTRAINT").upper().split()
            if odd := [way for way in held if way not in _WAYS]:
                raise row.error(f"RESTRAINT {odd[0]} is not known; write some of {' '.join(_WAYS)}")
            if held:
                self.tables.holds.append((node, [_WAYS.index(way) for way in held]))
            if row.text("SPRINGPROP", "LINKPROP"):
                raise row.error("its spring has no counterpart; hold it, or model it as a frame")
            name = row.text("DIAPH")
            if name in self.rigid:
                self.bodies[name, row.text("2")].add(node)
            elif name.upper() == "DISCONNECTED":
                self.loose.add(node)
        for row in self.file.of("POINTLOAD"):
            newton = -row.real("FZ", "UZ", usual=0.0) * self._share(row) * self.tables.force
            if newton > 0.0:
                node = self.node(row, row.named("1"), row.named("2"))
                self.tables.point_mass(row, node, [newton / GRAVITY] * 3, np.zeros(3))

    def _share(self, row: Row) -> float:
        return self.source.patterns.get(row.text("LC"), 0.0)

    def _loads(self, kind: str) -> dict[tuple[str, str], float]:
        """Loads downwards that are mass, in the file's units, by object and story."""
        found: dict[tuple[str, str], float] = defaultdict(float)
        there = {row.text("1"): row for row in self.file.of(kind.removesuffix("LOAD"))}
        for row in self.file.of(kind):
            known(row, there, row.text("1"), kind.removesuffix("LOAD"))
            if "GRAV" in row.text("DIR").upper() and self._share(row):
                start = row.real("FVAL", "FSTART", "FA")
                mean = 0.5 * (start + row.real("FEND", "FB", usual=start))
                found[row.text("1"), row.text("2")] += self._share(row) * mean
        return found

    def lines(self) -> None:
        all_lines, loads = once(self.file.of("LINE"), "1"), self._loads("LINELOAD")
        for row in self.file.merged["LINEASSIGN"].values():
            name, story, section = row.named("1"), row.named("2"), row.text("SECTION")
            line = known(row, all_lines, name, "LINE")
            if line.text("2").upper() not in ("COLUMN", "BEAM", "BRACE"):
                raise line.error(f"a {line.text('2')} has no counterpart; draw it as a frame")
            ends = [
                self.node(row, line.named("3"), story, int(line.real("5", usual=0.0))),
                self.node(row, line.named("4"), story),
            ]
            released = row.text("RELEASE").upper().split()
            if released == ["PINNED"]:
                released = ["TI", "M2I", "M3I", "M2J", "M3J"]
            if not set(released) <= set(_RELEASED):
                raise row.error(f"its release {' '.join(released)!r} is not known; write M2I M3I")
            rigid = [row.real(k, usual=0.0) for k in ("LENGTHOFFI", "LENGTHOFFJ", "RIGIDZONE")]
            moved = np.array([[row.real(f"OFFSET{a}{e}", usual=0.0) for a in "XYZ"] for e in "IJ"])
            stiff = row.flag("TRANSFORMSTIFFNESSFOROFFSETS")
            if rigid[2] and not any(rigid[:2]):
                self.tables.changes["frames with automatic end offsets, which are left out"] += 1
            add_frame(
                self.tables,
                row,
                ends,
                self.properties,
                section,
                self.source,
                angle=row.real("ANG", usual=0.0),
                released=released,
                rigid=rigid,
                cardinal=int(row.real("CARDINALPT", usual=10.0)) if stiff else 10,
                moved=moved if stiff else None,
                changes=row,
                load=loads[name, story] * self.tables.force / self.tables.length / GRAVITY,
            )

    def areas(self) -> None:
        tables = self.tables
        all_areas, loads = once(self.file.of("AREA"), "1"), self._loads("AREALOAD")
        found = []
        for row in self.file.merged["AREAASSIGN"].values():
            name, story, section = row.named("1"), row.named("2"), row.text("SECTION")
            area = known(row, all_areas, name, "AREA")
            count = int(area.real("3"))
            below = [int(area.real(f"{4 + count + k}", usual=0.0)) for k in range(count)]
            corners = [
                self.node(row, area.named(f"{4 + k}"), story, below[k]) for k in range(count)
            ]
            diaphragm = row.text("DIAPH")
            if diaphragm.upper() not in ("", "NONE", "DISCONNECTED"):
                known(row, self.diaphragms, diaphragm, "DIAPHRAGM")
            if diaphragm in self.rigid:
                points = np.array(tables.points)
                level = np.abs(points[:, 2] - points[corners[0], 2]) < 1e-3
                inside = np.flatnonzero(level & _inside(points, points[corners]))
                self.bodies[diaphragm, story].update({*inside.tolist(), *corners} - self.loose)
            found.append((row, name, story, section, corners))
        tables.bodies += [np.array(sorted(nodes)) for nodes in self.bodies.values()]
        for row, name, story, section, corners in found:
            add_area(
                tables,
                row,
                corners,
                self.properties,
                section,
                self.source,
                changes=row,
                load=loads[name, story] * tables.force / tables.length**2 / GRAVITY,
                in_diaphragm=any(nodes.issuperset(corners) for nodes in self.bodies.values()),
            )


def _inside(points: Floats, corners: Floats) -> Flags:
    """Which points (n, 3) lie in a polygon (k, 3), seen from above."""
    odd, edge = np.zeros((2, len(points)), dtype=np.bool_)
    x, y = points[:, 0], points[:, 1]
    for (x0, y0, _), (x1, y1, _) in pairwise([*corners, corners[0]]):
        crossed = (y0 > y) != (y1 > y)
        odd ^= crossed & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0 if y1 != y0 else 1.0))
        side = np.hypot(x1 - x0, y1 - y0)
        off = np.abs((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) / max(side, 1e-300)
        along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / max(side, 1e-300) ** 2
        edge |= (off < 1e-3) & (along >= 0.0) & (along <= 1.0)
    return np.asarray(odd | edge)
