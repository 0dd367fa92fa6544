"""What a deck of Nastran says as a finite-element model."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.deck import LEFT_OUT, MEND, TAKEN, Card, read_deck
from femupdate.building.model_tables import LEVEL, ModelFile, ModelTables, Stuff, known
from femupdate.building.sections import (
    CircleSection,
    ISection,
    PipeSection,
    RectangleSection,
    SectionFigures,
    TSection,
    rectangle_torsion_constant,
)
from femupdate.errors import BuildingError

_LINES = ("PBAR", "PBARL", "PBEAM", "PBEAML", "PROD", "PTUBE")
_DIRECTED = ("MAT2", "MAT3", "MAT8", "MAT9", "MAT10", "MAT11")  # of other materials
_OTHER = ("PSOLID", "PSHEAR", "PCOMP", "PCOMPG", "PBEND", "PBUSH")
# A direction of Nastran's element axes in those of our beams: its y is our z, its z our -y.
_OURS = np.array([0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10])


@dataclass(frozen=True)
class NastranModel(ModelFile[Card]):
    """A deck."""

    program: ClassVar[str] = "Nastran"
    node_kind: ClassVar[str] = "GRID"
    what: ClassVar[str] = "cards"
    mends: ClassVar[Mapping[str, str]] = MEND
    chosen: int | None = None  # the set of SPC that case control chooses

    @classmethod
    def opened(cls, file: Path) -> "NastranModel":
        """The model of a file."""
        return cls(file, *read_deck(file))

    @property
    def materials(self) -> list[tuple[float, float]]:
        return [(c.real(1, 0.0), c.real(4, 0.0) * self.mass_factor) for c in self.of("MAT1")]

    @property
    def left_out(self) -> dict[str, int]:
        names = [n for n in self.counts if LEFT_OUT.fullmatch(n) and n not in TAKEN]
        counts = {name: self.counts[name] for name in names}
        read = ("WTMASS", "COUPMASS")
        other = [card for card in self.of("PARAM") if card.text(0).upper() not in read]
        return counts | ({"PARAM": len(other)} if other else {})

    @property
    def unknown(self) -> list[str]:
        """Names of cards that are neither taken nor known to change nothing."""
        return [name for name in self.counts if name not in TAKEN and not LEFT_OUT.fullmatch(name)]

    def by_number(self, *names: str) -> dict[int, Card]:
        """Cards by their identification, which no two may share."""
        cards: dict[int, Card] = {}
        for card in self.of(*names):
            number = card.whole(0)
            if number in cards:
                line = cards[number].line
                raise card.error(f"line {line} has this number already; renumber or remove one")
            cards[number] = card
        return cards

    @property
    def mass_factor(self) -> float:
        """PARAM WTMASS: what densities and masses are multiplied by."""
        cards = [card for card in self.of("PARAM") if card.text(0).upper() == "WTMASS"]
        if cards and not cards[-1].real(1) > 0.0:
            raise cards[-1].error("it must be positive; correct it")
        return cards[-1].real(1) if cards else 1.0

    @cached_property
    def systems(self) -> dict[int, "DeckSystem"]:
        """Systems by their number."""
        cards: dict[int, Card] = self.by_number("CORD2R", "CORD2C", "CORD2S")
        for card in self.of("CORD1R", "CORD1C", "CORD1S"):
            for k in range(0, len(card.data), 4):
                if card.text(k):
                    cards[card.whole(k)] = replace(card, data=card.data[k : k + 4])
        grids = self.by_number("GRID")
        placed = {0: DeckSystem("R", np.zeros(3), np.eye(3))}

        def place(number: int, user: Card, way: tuple[int, ...]) -> DeckSystem:
            if number in placed:
                return placed[number]
            card = known(user, cards, number, "CORD2R")
            if number in way:
                ring = " to ".join(map(str, (*way[way.index(number) :], number)))
                raise card.error(f"systems refer to each other in a circle ({ring}); correct one")
            if card.name.startswith("CORD1"):
                rows = [known(card, grids, card.whole(k), "GRID") for k in (1, 2, 3)]
                named = [(row, row.whole(1, 0), row.reals(2)) for row in rows]
            else:
                named = [(card, card.whole(1, 0), card.reals(k)) for k in (2, 5, 8)]
            a, b, c = (place(n, row, (*way, number)).point(p) for row, n, p in named)
            across = np.cross(b - a, c - a)
            if np.linalg.norm(across) <= 1e-9 * np.linalg.norm(b - a) * np.linalg.norm(c - a):
                raise card.error("its three points lie on one line; correct one of them")
            z, y = (v / np.linalg.norm(v) for v in (b - a, across))
            placed[number] = DeckSystem(card.name[-1], a, np.stack([np.cross(y, z), y, z]))
            return placed[number]

        for number, card in cards.items():
            place(number, card, ())
        return placed

    def system(self, number: int, user: Card) -> "DeckSystem":
        """The system that a card names."""
        return known(user, self.systems, number, "CORD2R")

    def fill(self, tables: ModelTables) -> None:
        for card in self.of("PARAM"):
            if card.text(0).upper() == "COUPMASS" and tables.said.mass is None:
                said = "lumped" if card.whole(1) < 0 else "consistent"
                tables.said = replace(tables.said, mass=said)
                tables.changes[f"PARAM COUPMASS: masses of elements are {said}"] += 1
        self.by_number(*(name for name in TAKEN if re.match("C(?!ORD)|RB", name)))
        reading = _DeckReading(self, tables)
        reading.surfaces()
        reading.beams()
        reading.links()
        reading.springs()
        reading.fixed()


@dataclass(frozen=True)
class DeckSystem:
    """A system of coordinates in the basic one."""

    kind: str  # "R", "C" or "S": rectangular, cylindrical or spherical
    origin: Floats  # (3,)
    axes: Floats  # (3, 3), as rows

    def point(self, given: Floats) -> Floats:
        """The point (3,) of coordinates, whose angles are in degrees."""
        first, *angles = given[0], *np.deg2rad(given[1:])
        if self.kind == "C":
            given = np.array([first * np.cos(angles[0]), first * np.sin(angles[0]), given[2]])
        elif self.kind == "S":
            theta, phi = angles
            across = np.sin(theta) * np.array([np.cos(phi), np.sin(phi)])
            given = first * np.array([*across, np.cos(theta)])
        return self.origin + given @ self.axes

    def at(self, point: Floats) -> Floats:
        """Directions of motion at a point, as rows (3, 3)."""
        x, y, z = (point - self.origin) @ self.axes.T
        if self.kind == "R" or not np.hypot(x, y) > 0.0:
            return self.axes
        (c, s), flat = np.array([x, y]) / np.hypot(x, y), np.hypot(x, y)
        outwards, round_it, up = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        if self.kind == "C":
            return np.stack([outwards, round_it, up]) @ self.axes
        size, down = np.hypot(z, flat), z * outwards - flat * up
        return np.stack([z * up + flat * outwards, down, size * round_it]) / size @ self.axes


class _DeckReading:
    """The cards of a deck, read into tables one kind after the other."""

    def __init__(self, deck: NastranModel, tables: ModelTables) -> None:
        self.deck, self.tables, self.length = deck, tables, tables.length
        tables.mass *= deck.mass_factor
        self.turns: dict[int, Floats] = {}
        for name, card in deck.by_number("GRID").items():
            point = deck.system(card.whole(1, 0), card).point(card.reals(2))
            node = tables.node(str(name), point)
            if card.whole(5, 0):
                self.turns[node] = deck.system(card.whole(5), card).at(point)
        self.properties = deck.by_number("PSHELL", *_LINES, *_OTHER)
        self.materials = deck.by_number("MAT1", *_DIRECTED)
        self.plate, self.section = cache(self._plate), cache(self._section)
        self.material = cache(self._material)

    def node(self, card: Card, number: int) -> int:
        return self.tables.find(card, str(card.whole(number)))

    def directions(self, card: Card, node: int, components: tuple[int, ...]) -> list[int]:
        """The same directions in global axes; those of the node may be turned."""
        turn = self.turns.get(node)
        if turn is None:
            return list(components)
        found: list[int] = []
        for half in (0, 3):
            some = [c - half for c in components if half <= c < half + 3]
            axes = np.abs(turn[some]).argmax(axis=1) if some else np.zeros(0, dtype=np.int64)
            if 0 < len(some) < 3 and (np.abs(turn[some, axes]) < 1.0 - 1e-6).any():
                raise card.error("a direction is along no global axis; turn the system of the node")
            found += [int(axis) + half for axis in axes] if len(some) < 3 else range(half, half + 3)
        return found

    def _material(self, number: int, user: Card) -> Stuff:
        card = known(user, self.materials, number, "MAT1")
        if card.name != "MAT1":
            raise user.error(f"material {number} is a {card.name}; name a MAT1, alike in all axes")
        young, shear, ratio = card.real(1, 0.0), card.real(2, 0.0), card.real(3, 0.0)
        if not card.text(3) and young and shear:
            ratio = 0.5 * young / shear - 1.0
        young = young or 2.0 * shear * (1.0 + ratio)
        return self.tables.material(card, young, ratio, card.real(4, 0.0), shear)

    def _property(self, card: Card, allowed: Sequence[str]) -> Card:
        number = card.whole(1, card.whole(0))
        found = self.properties.get(number)
        if found is None:
            raise card.error(f"there is no property {number}; add it as {' or '.join(allowed)}")
        if found.name not in allowed:
            raise card.error(f"property {number} is a {found.name}; name a {' or '.join(allowed)}")
        return found

    def _plate(self, card: Card) -> tuple[Stuff, float, float, float]:
        """Material, thickness (m), factor on the bending stiffness, mass (kg/m2)."""
        thickness, bending = card.real(2), card.real(4, 1.0)
        if not card.whole(1, 0) or card.whole(3, 0) <= 0:
            raise card.error("a membrane or a plate alone is no shell here; give MID1 and MID2")
        if card.whole(18, 0):
            raise card.error("MID4 couples membrane and bending, which no shell does; empty it")
        if card.whole(5, 0) != card.whole(1) or abs(card.real(6, 5.0 / 6.0) - 5.0 / 6.0) > 1e-3:
            self.tables.changes["PSHELL of another shear stiffness: by 5/6 of the thickness"] += 1
        stuff, bent = (self.material(card.whole(k), card) for k in (1, 3))
        if abs(stuff.ratio - bent.ratio) > 1e-9:
            raise card.error("its materials must have one Poisson's ratio; correct NU of one")
        thickness *= self.length
        mass = stuff.density * thickness + card.real(7, 0.0) * self.tables.mass / self.length**2
        return stuff, thickness, bending * bent.young / stuff.young, mass

    def surfaces(self) -> None:
        for names, count in ((("CQUAD4", "CQUADR"), 4), (("CTRIA3", "CTRIAR"), 3)):
            for card in self.deck.of(*names):
                stuff, thickness, bending, mass = self.plate(self._property(card, ("PSHELL",)))
                corners = [self.node(card, 2 + k) for k in range(count)]
                if card.real(3 + count, 0.0):
                    raise card.error("an offset shell is not modelled; leave ZOFFS empty")
                if any(card.text(10 + k) for k in range(count)):
                    raise card.error("T1 to T4 are not modelled; give the thickness in PSHELL")
                self.tables.area(card, corners, stuff, thickness, bending=bending, area_mass=mass)

    def _shape(self, card: Card) -> tuple[SectionFigures, float]:
        """Figures of PBARL and PBEAML, and their mass per length beside the material's."""
        shape = card.text(3).upper()
        if shape not in SHAPES:
            raise card.error(f"{shape!r} is none of {', '.join(SHAPES)}; write PBAR")
        count, figures = SHAPES[shape]
        sides = [self.length * card.real(8 + k) for k in range(count)]
        second = 9 + count  # where the other end of a beam begins
        for k in range(count if card.text(second) else 0):
            if self.length * card.real(second + 2 + k, card.real(8 + k)) != sides[k]:
                raise card.error("a tapered beam is not modelled; give it a mean section")
        try:
            return figures(*sides), card.real(8 + count, 0.0)
        except ValueError:
            raise card.error(f"its dimensions make no {shape}; correct them") from None

    def _section(self, card: Card) -> tuple[SectionFigures, float, Stuff]:
        """Figures, product of inertia (m4), and material with the section's extra mass."""
        product = 0.0
        if card.name in ("PBARL", "PBEAML"):
            figures, extra = self._shape(card)
        else:
            shear, first, second = [0.0, 0.0], 0.0, 0.0
            if card.name == "PTUBE":
                wide, thick = card.real(2), card.real(3, 0.0)
                hole, extra = wide - 2.0 * thick if thick else 0.0, card.real(4, 0.0)
                area = 0.25 * np.pi * (wide**2 - hole**2)
                torsion = np.pi / 32.0 * (wide**4 - hole**4)
            elif card.name == "PROD":
                area, torsion, extra = card.real(2), card.real(3, 0.0), card.real(5, 0.0)
            elif card.name == "PBAR":
                area, first, second, torsion, extra = (card.real(k, 0.0) for k in range(2, 7))
                shear = [card.real(16, 0.0), card.real(17, 0.0)]
                product = card.real(18, 0.0)
            else:
                given = [card.real(k, 0.0) for k in range(2, 8)]
                area, first, second, product, torsion, extra = given
                shear = _uniform(card)
            shear = [share * area for share in shear]
            rod = card.name in ("PROD", "PTUBE")
            if extra < 0.0:
                raise card.error("the area must be positive and nothing negative; correct it")
            figures = self.tables.section(card, area, (first, second), torsion, shear, rod=rod)
            product *= self.length**4
        stuff = self.material(card.whole(1), card)
        density = stuff.density + extra * self.tables.mass / self.length / figures.area
        return figures, product, replace(stuff, density=density)

    def beams(self) -> None:
        tables = self.tables
        for card in self.deck.of("CBAR", "CBEAM", "CROD", "CTUBE", "CONROD"):
            rod, first = card.name not in ("CBAR", "CBEAM"), 1 if card.name == "CONROD" else 2
            if card.name == "CONROD":  # its property stands with it
                named = replace(card, name="PROD", data=("", *card.data[3:]))
            else:
                named = self._property(card, _LINES[4:] if rod else _LINES[:4])
            figures, product, stuff = self.section(named)
            ends = [self.node(card, first), self.node(card, first + 1)]
            arms, pins = np.zeros((2, 3)), np.zeros(12, dtype=np.bool_)
            if rod:
                pins[[4, 5, 10, 11]] = True
            else:
                for end in range(2):
                    arm = self.length * card.reals(10 + 3 * end)
                    arms[end] = arm @ self.turns.get(ends[end], np.eye(3))
                    which = np.array(card.components(8 + end), dtype=np.int64) + 6 * end
                    pins[_OURS[which]] = True
                if card.text(7).upper() not in ("", "GGG"):
                    raise card.error("offsets in the element's axes are not known; write GGG")
            axis = tables.points[ends[1]] + arms[1] - tables.points[ends[0]] - arms[0]
            up = self._up(card, ends, arms, axis)
            if product:
                self.tables.changes["bars with I12: turned into their principal axes"] += 1
                figures, up = _principal(figures, product, up, axis)
            tables.line(card, ends, figures, stuff, up, pins=pins, arms=arms)

    def _up(self, card: Card, ends: list[int], arms: Floats, axis: Floats) -> Floats:
        """Vector across a line: its y axis in Nastran, its z axis here."""
        if card.name not in ("CBAR", "CBEAM"):
            return np.eye(3)[int(np.abs(axis).argmin())]
        if card.text(4) and not card.text(5) and "." not in card.text(4):
            points = self.tables.points
            return np.asarray(points[self.node(card, 4)] - points[ends[0]] - arms[0])
        return np.asarray(card.reals(4) @ self.turns.get(ends[0], np.eye(3)))

    def links(self) -> None:
        """RBE2, and masses, some of which stand off on rigid arms."""
        tables = self.tables
        for card in self.deck.of("RBE2"):
            master, tied = self.node(card, 1), card.components(2)
            # A real in the last place is a coefficient of thermal expansion.
            last = max(k for k, text in enumerate(card.data) if text)
            card = replace(card, data=card.data[:last]) if "." in card.text(last) else card
            if not tied or not any(card.data[3:]):
                raise card.error("it ties nothing; give components (CM) and nodes (GM)")
            for grid in card.numbers(3):
                slave, flags = tables.find(card, str(grid)), np.zeros(6, dtype=np.bool_)
                flags[self.directions(card, slave, tied)] = True
                tables.tie(card, master, slave, flags)
        for card in self.deck.of("RBAR"):
            ends, free = [self.node(card, k) for k in (1, 2)], [card.components(k) for k in (3, 4)]
            if {*map(len, free)} != {0, 6}:
                raise card.error("one end must be independent in 123456; give CNA or CNB alone")
            master = int(len(free[1]) == 6)
            flags = np.isin(np.arange(6), card.components(6 - master) or range(6))
            tables.tie(card, ends[master], ends[1 - master], flags)
        for card in self.deck.of("CONM2"):
            node, system = self.node(card, 1), card.whole(2, 0)
            place = tables.points[node] / self.length
            axes = self.deck.system(max(system, 0), card).at(place)
            arm = self.length * card.reals(4) @ axes
            arm = arm - tables.points[node] if system == -1 else arm
            if np.linalg.norm(arm) > LEVEL**2:
                tables.points.append(tables.points[node] + arm)
                tables.tie(card, node, len(tables.points) - 1)
                node = len(tables.points) - 1
                tables.changes["CONM2 off their nodes: at the end of a rigid arm"] += 1
            i11, i21, i22, i31, i32, i33 = (card.real(8 + k, 0.0) for k in range(6))
            whole = np.array([[i11, -i21, -i31], [-i21, i22, -i32], [-i31, -i32, i33]])
            whole = axes.T @ whole @ axes
            if np.abs(whole - np.diag(np.diag(whole))).max() > 1e-6 * np.abs(whole).max():
                tables.changes["CONM2 with products of inertia, which are left out"] += 1
            inertia = np.diag(whole) * tables.mass * self.length**2
            tables.point_mass(card, node, [card.real(3) * tables.mass] * 3, inertia)
        for card in self.deck.of("CMASS2"):
            node = self.node(card, 2)
            way = self.directions(card, node, card.components(3))
            if len(way) != 1 or card.text(4):
                raise card.error("a mass at one node in one direction is known; give G1 and C1")
            scale = tables.mass * (self.length**2 if way[0] > 2 else 1.0)
            values = card.real(1) * scale * np.eye(6)[way[0]]
            tables.point_mass(card, node, values[:3], values[3:])

    def springs(self) -> None:
        rates: dict[int, float] = {}
        for card in self.deck.of("PELAS"):
            rates |= {card.whole(k): card.real(k + 1) for k in (0, 4) if card.text(k)}
        for card in self.deck.of("CELAS1", "CELAS2", "CDAMP2"):
            ends = [(k, c) for k, c in ((2, 3), (4, 5)) if card.whole(k, 0)]
            if not ends:
                raise card.error("it joins nothing; give G1")
            joined = []
            for k, c in ends:
                node = self.node(card, k)
                way = self.directions(card, node, card.components(c))
                if len(way) != 1:
                    raise card.error("a spring acts in one direction; give one digit from 1 to 6")
                joined.append((node, way[0]))
            if len({way for _, way in joined}) > 1:
                raise card.error("a spring between two directions is not modelled; give one")
            first, direction = joined[0]
            second = joined[1][0] if len(joined) > 1 else -1
            if card.name == "CDAMP2":
                self.tables.spring(first, second, direction, 0.0, card.real(1))
                continue
            named = card.name == "CELAS1"
            rate = known(card, rates, card.whole(1), "PELAS") if named else card.real(1)
            if rate < 0.0:
                raise card.error("its stiffness is negative; give K of 0 or more")
            self.tables.spring(first, second, direction, rate)
        for card in self.deck.of("CBUSH"):
            bush, first = self._property(card, ("PBUSH",)), self.node(card, 2)
            second, place = -1, self.tables.points[first]
            if card.whole(3, 0):
                second = self.node(card, 3)
                if np.linalg.norm(self.tables.points[second] - place) > LEVEL:
                    raise card.error("its nodes lie apart; put them in one place, or write CBAR")
            axes = self.deck.system(card.whole(7, 0), card).at(place / self.length)
            for start in (k for k in range(1, len(bush.data), 8) if bush.text(k) in ("K", "B")):
                for number in (k for k in range(6) if bush.real(start + 1 + k, 0.0)):
                    half, which = divmod(number, 3)
                    along = int(np.abs(axes[which]).argmax())
                    if abs(axes[which, along]) < 1.0 - 1e-6:
                        raise card.error("it acts along no global axis; turn its system (CID)")
                    rate, direction = bush.real(start + 1 + number), 3 * half + along
                    pair = (rate, 0.0) if bush.text(start) == "K" else (0.0, rate)
                    self.tables.spring(first, second, direction, *pair)

    def fixed(self) -> None:
        """What SPC, SPC1 and the permanent constraints of GRID hold."""
        tables = self.tables
        cards = self.deck.of("SPC", "SPC1")
        sets = sorted({card.whole(0) for card in cards})
        sums, chosen = {card.whole(0): card for card in self.deck.of("SPCADD")}, self.deck.chosen
        unclear = len(sets) > 1 and len(sums) != 1 if chosen is None else chosen not in sums
        if unclear and cards and chosen not in sets:
            said = "no SPC =" if chosen is None else f"SPC = {chosen}"
            raise cards[0].error(
                f"there are sets {', '.join(map(str, sets))}, and {said} in case control; keep "
                "one, or write SPC = before BEGIN BULK"
            )
        if chosen is None:
            chosen = next(iter(sums or sets), 0)
        used = set(sums[chosen].numbers(1)) if chosen in sums else {chosen}

        def hold(card: Card, node: int, number: int) -> None:
            directions = self.directions(card, node, card.components(number))
            tables.holds.append((node, directions))

        for card in cards:
            if card.whole(0) not in used:
                tables.skipped[f"{card.name} of another set"] += 1
            elif card.name == "SPC1":
                through = any(text.upper() == "THRU" for text in card.data)
                for grid in card.numbers(2):
                    if not through or str(grid) in tables.number:
                        hold(card, tables.find(card, str(grid)), 1)
            else:
                for k in (k for k in (1, 4) if card.text(k)):
                    hold(card, self.node(card, k), k + 1)
        for card in self.deck.of("GRID"):
            if card.text(6):
                hold(card, self.node(card, 0), 6)


def _box(width: float, depth: float, flange: float, web: float) -> SectionFigures:
    if width <= 2.0 * web:
        raise ValueError
    flanges = [(width, flange, 0.0, side * 0.5 * (depth - flange)) for side in (-1.0, 1.0)]
    webs = [(web, depth - 2.0 * flange, side * 0.5 * (width - web), 0.0) for side in (-1.0, 1.0)]
    between = (width - web) ** 2 * (depth - flange) ** 2
    around = width * web + depth * flange - web**2 - flange**2
    return replace(
        _plates(*flanges, *webs),
        shear_area_y=5.0 / 3.0 * width * flange,
        shear_area_z=5.0 / 3.0 * depth * web,
        torsion_constant=2.0 * flange * web * between / around,
    )


def _i(h: float, low: float, high: float, web: float, below: float, above: float) -> SectionFigures:
    if low != high or below != above:
        clear = h - below - above
        flanges = ((low, below, 0.0, 0.5 * below), (high, above, 0.0, h - 0.5 * above))
        return _plates(*flanges, (web, clear, 0.0, below + 0.5 * clear))
    return ISection(
        shape="I", width=low, depth=h, web_thickness=web, flange_thickness=below
    ).figures()


def _plates(*plates: tuple[float, float, float, float]) -> SectionFigures:
    """Figures of rectangles: width, depth, and where the middle is across and up."""
    width, depth, across, up = np.array(plates).T
    if not min(width.min(), depth.min()) > 0.0:
        raise ValueError
    area, flat = width * depth, width > depth
    sides = ((across, width), (up, depth))
    reach = [float(np.max(m + 0.5 * s) - np.min(m - 0.5 * s)) for m, s in sides]
    y, z = (side - area @ side / area.sum() for side in (across, up))
    shear = [5.0 / 6.0 * float(area[some].sum() or area.sum()) for some in (flat, ~flat)]
    return SectionFigures(
        area=float(area.sum()),
        shear_area_y=shear[0],
        shear_area_z=shear[1],
        inertia_y=float(area @ (depth**2 / 12.0 + z**2)),
        inertia_z=float(area @ (width**2 / 12.0 + y**2)),
        torsion_constant=float(sum(map(rectangle_torsion_constant, width, depth))),
        extent=(reach[0], reach[1]),
    )


def _channel(arm: float, web: float, clear: float, depth: float) -> SectionFigures:
    flange, middle = 0.5 * (depth - clear), 0.5 * (web + arm)
    arms = [(arm, flange, middle, side * 0.5 * (clear + flange)) for side in (-1.0, 1.0)]
    return _plates((web, depth, 0.0, 0.0), *arms)


# Sections of PBARL and PBEAML: how many sides they have, and their figures.
SHAPES: dict[str, tuple[int, Callable[..., SectionFigures]]] = {
    "ROD": (1, lambda r: CircleSection(shape="circle", diameter=2.0 * r).figures()),
    "TUBE2": (2, lambda r, t: PipeSection(shape="pipe", diameter=2.0 * r, thickness=t).figures()),
    "TUBE": (
        2,
        lambda r, inner: PipeSection(shape="pipe", diameter=2.0 * r, thickness=r - inner).figures(),
    ),
    "BAR": (2, lambda b, h: RectangleSection(shape="rectangle", width=b, depth=h).figures()),
    "T": (
        4,
        lambda b, h, flange, web: TSection(
            shape="T", width=web, depth=h, flange_width=b, flange_thickness=flange
        ).figures(),
    ),
    "I": (6, _i),
    "I1": (4, lambda a, w, clear, h: _i(h, a + w, a + w, w, *(0.5 * (h - clear),) * 2)),
    "H": (
        4,
        lambda clear, two, h, web: _plates(
            (0.5 * two, h, -0.5 * clear - 0.25 * two, 0.0),
            (0.5 * two, h, 0.5 * clear + 0.25 * two, 0.0),
            (clear, web, 0.0, 0.0),
        ),
    ),
    "CHAN": (4, lambda b, h, w, f: _channel(b - w, w, h - 2.0 * f, h)),
    "CHAN1": (4, lambda a, w, clear, h: _channel(a, w, clear, h)),
    "T1": (
        4,
        lambda h, arm, flange, web: _plates(
            (flange, h, 0.0, 0.0), (arm, web, -0.5 * (flange + arm), 0.0)
        ),
    ),
    "CROSS": (
        4,
        lambda a, w, h, f: _plates(
            (w, h, 0.0, 0.0),
            (0.5 * a, f, -0.25 * a - 0.5 * w, 0.0),
            (0.5 * a, f, 0.25 * a + 0.5 * w, 0.0),
        ),
    ),
    "BOX": (4, _box),
}
SHAPES["T2"] = SHAPES["T"]


def _uniform(card: Card) -> list[float]:
    """Shear factors of a PBEAM, which must have one section and its axis on the line."""
    at = 16
    while card.text(at).upper() in ("YES", "YESA", "NO"):
        for k in range(2, 8):
            if abs(card.real(at + k, card.real(k, 0.0)) - card.real(k, 0.0)) > 0.0:
                raise card.error("a tapered beam is not modelled; give it a mean section")
        at += 16 if card.text(at).upper() == "YES" else 8
    if any(card.real(at + 8 + k, 0.0) for k in range(8)):
        raise card.error("a neutral axis off the line (N1, N2) is not modelled; offset the beam")
    return [card.real(at, 1.0), card.real(at + 1, 1.0)]


def _principal(
    figures: SectionFigures, product: float, up: Floats, axis: Floats
) -> tuple[SectionFigures, Floats]:
    """A section about its principal axes, and the direction of its depth."""
    x = axis / np.linalg.norm(axis)
    up = up - (up @ x) * x
    up /= np.linalg.norm(up)
    tensor = np.array([[figures.inertia_y, product], [product, figures.inertia_z]])
    values, vectors = np.linalg.eigh(tensor)
    first = int(np.abs(vectors[0]).argmax())
    turned = vectors[0, first] * up + vectors[1, first] * np.cross(x, up)
    inertia = float(values[first]), float(values[1 - first])
    if min(inertia) <= 0.0:
        raise BuildingError(f"a section's I12 {product:.4g} m4 is too large for I1 and I2")
    return replace(figures, inertia_y=inertia[0], inertia_z=inertia[1]), turned
