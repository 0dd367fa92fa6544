"""What a deck of Nastran says as a finite-element model: nothing is dropped without a word."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.deck import TAKEN, Card, Deck
from femupdate.building.entry import Complaint
from femupdate.building.mesh_check import cell_kinds, check_elements, loose_pieces, place
from femupdate.building.sections import (
    CircleSection,
    ISection,
    PipeSection,
    RectangleSection,
    SectionFigures,
    TSection,
)
from femupdate.errors import BuildingError
from femupdate.fe.element import Elements, area_vectors
from femupdate.fe.elements.beam import Beams
from femupdate.fe.elements.shell import Shells
from femupdate.fe.elements.triangle import Triangles
from femupdate.fe.links import rigid_arms
from femupdate.fe.model import (
    CONSTANT,
    DOF_PER_NODE,
    FiniteElementModel,
    PointMasses,
    RigidLinks,
    Springs,
)
from femupdate.fe.surface import Surface

LEVEL = 1e-3  # m; what is nearer than this to a floor's level is on it
_SAME_PLANE = 0.985  # cosine of the angle between shells of one wall
# Of sections that a deck gives none: bending over the area squared, torsion over bending.
_LITTLE, _TWIST = 1e-4, 1e-2
_LINES = ("PBAR", "PBARL", "PBEAM", "PBEAML", "PROD")
# A direction of Nastran's element axes in those of our beams: its y is our z, its z our -y.
_OURS = np.array([0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10])


@dataclass(frozen=True)
class DeckModel:
    """A deck as a model in SI, and what became of its cards."""

    model: FiniteElementModel  # groups are stories
    held: Integers  # nodes that are held, or stand on springs
    walls: tuple[str, ...]  # names of the walls
    # which of them each element belongs to, -1 for none, one array a block of elements
    wall_of: tuple[Integers, ...]
    notes: tuple[str, ...]  # a sentence each


def deck_model(
    deck: Deck,
    length: float,
    force: float,
    *,
    base: float = 0.0,
    levels: Floats | None = None,
    ignored: tuple[str, ...] = (),
) -> DeckModel:
    """Return the model of a deck.

    Args:
        length: m in the deck's unit of length.
        force: N in the deck's unit of force.
        base: level of the base, m.
        levels: (stories,) of the floors above the base, m; all is one story where None.
        ignored: names of cards that are left out on their user's word.

    Raises:
        BuildingError: a card is unknown, wrong or refers to what is not there, or a part of the
            mesh hangs in the air.
    """
    deck.refuse_unknown(ignored)
    reading = _Reading(deck, length, force, base)
    blocks = [
        reading.surfaces(("CQUAD4", "CQUADR"), Shells),
        reading.surfaces(("CTRIA3", "CTRIAR"), Triangles),
        reading.beams(),
    ]
    blocks = [block for block in blocks if len(block)]
    if not blocks:
        raise BuildingError(f"{deck.file.name}: it has no shells, bars or beams; mesh the building")
    links, masses, springs = reading.links(), reading.masses(), reading.springs()
    points = np.array(reading.points)
    fixed = np.zeros((len(points), DOF_PER_NODE), dtype=np.bool_)
    fixed[: len(reading.number)] = reading.fixed()
    tops = np.array([np.inf]) if levels is None else levels
    blocks = [_told(block, points, tops) for block in blocks]
    model = FiniteElementModel(points, fixed, len(tops), tuple(blocks), masses, springs, links)
    model, names = _used(model, deck)
    reading.skipped["GRID that nothing uses"] = len(reading.number) - int((names > 0).sum())
    loose = ~_stiff(model) & ~model.fixed
    held = np.flatnonzero(model.fixed[:, :3].any(axis=1))
    ground = model.springs.nodes[model.springs.nodes[:, 1] < 0, 0]
    held = np.union1d(held, ground)
    _check(model, held, names, deck.file.name)
    model = replace(model, fixed=model.fixed | loose)
    walls, wall_of = _walls(model)
    notes = reading.notes(model, levels)
    if loose.any():
        count = int(loose.any(axis=1).sum())
        notes.append(f"Changed: at {count} nodes what nothing stiffens is held.")
    return DeckModel(model, held, walls, wall_of, tuple(notes))


class _Reading:
    """The cards of a deck, read into arrays of SI one kind after the other."""

    def __init__(self, deck: Deck, length: float, force: float, base: float) -> None:
        self.deck, self.length, self.force = deck, length, force
        self.mass = force / length * deck.mass_factor
        self.stress = force / length**2
        cards = deck.by_number("GRID")
        self.number = {grid: k for k, grid in enumerate(cards)}
        self.points: list[Floats] = []  # those of offset masses come behind
        self.turns: dict[int, Floats] = {}
        for k, card in enumerate(cards.values()):
            origin, axes = deck.system(card.whole(1, 0), card)
            given = np.array([card.real(2 + i, 0.0) for i in range(3)])
            self.points.append(length * (origin + given @ axes) - [0.0, 0.0, base])
            if card.whole(5, 0):
                self.turns[k] = deck.system(card.whole(5), card)[1]
        self.properties = deck.by_number("PSHELL", *_LINES)
        self.materials = deck.by_number("MAT1")
        self.changes: Counter[str] = Counter()
        self.skipped: Counter[str] = Counter()  # whose first word is the card's name
        self.own_mass = 0.0
        self.plate, self.section = cache(self._plate), cache(self._section)
        self.material = cache(self._material)

    def node(self, card: Card, number: int) -> int:
        grid = card.whole(number)
        if grid not in self.number:
            raise card.error(f"there is no GRID {grid}; add it or correct the number")
        return self.number[grid]

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

    def _material(self, number: int, user: Card) -> tuple[float, float, float, float]:
        """Young's modulus (Pa), Poisson's ratio, G over that of both, density (kg/m3)."""
        card = self.materials.get(number)
        if card is None:
            raise user.error(f"there is no MAT1 {number}; add it or correct the number")
        young, shear, ratio = card.real(1, 0.0), card.real(2, 0.0), card.real(3, 0.0)
        if not card.text(3) and young and shear:
            ratio = 0.5 * young / shear - 1.0
        young = young or 2.0 * shear * (1.0 + ratio)
        if not young > 0.0 or not 0.0 <= ratio < 0.5 or card.real(4, 0.0) < 0.0:
            raise card.error(
                "E must be positive, NU from 0 to below .5, RHO not negative; correct it"
            )
        share = shear / (0.5 * young / (1.0 + ratio)) if shear else 1.0
        share = 1.0 if abs(share - 1.0) < 1e-4 else share
        density = card.real(4, 0.0) * self.mass / self.length**3
        return young * self.stress, ratio, share, density

    def _property(self, card: Card, allowed: Sequence[str]) -> Card:
        number = card.whole(1, card.whole(0))
        found = self.properties.get(number)
        if found is None:
            raise card.error(f"there is no property {number}; add it as {' or '.join(allowed)}")
        if found.name not in allowed:
            raise card.error(f"property {number} is a {found.name}; name a {' or '.join(allowed)}")
        return found

    def _plate(self, card: Card) -> tuple[float, float, float, float]:
        """Thickness, modulus, Poisson's ratio and density of the shell that is as stiff."""
        thickness, bending = card.real(2), card.real(4, 1.0)
        if not card.whole(1, 0) or card.whole(3, 0) <= 0:
            text = "a membrane or a plate alone is no shell here; give MID1 and MID2"
            raise card.error(text)
        if card.whole(18, 0):
            raise card.error(
                "MID4 couples membrane and bending, which no shell here does; empty it"
            )
        if not thickness > 0.0 or not bending > 0.0:
            raise card.error("thickness and bending must be positive; correct them")
        young, ratio, _, density = self.material(card.whole(1), card)
        bent, other, _, _ = self.material(card.whole(3), card)
        if abs(ratio - other) > 1e-9:
            raise card.error("its materials must have one Poisson's ratio; correct NU of one")
        thickness *= self.length
        area = density * thickness + card.real(7, 0.0) * self.mass / self.length**2
        # The shell whose membrane and bending are both as given.
        factor = 1.0 if bent == young and bending == 1.0 else float(np.sqrt(bending * bent / young))
        if factor != 1.0:
            self.changes["PSHELL with another bending stiffness: an equivalent thickness"] += 1
        return thickness * factor, young / factor, ratio, area / (thickness * factor)

    def surfaces(self, names: tuple[str, ...], element: type[Surface]) -> Surface:
        """All shells of one kind."""
        corners, rows, count = [], [], element.node_count()
        for card in self.deck.of(*names):
            plate = self.plate(self._property(card, ("PSHELL",)))
            corners.append([self.node(card, 2 + k) for k in range(count)])
            if card.real(3 + count, 0.0):
                raise card.error("an offset shell is not modelled; leave ZOFFS empty")
            if any(card.text(10 + k) for k in range(count)):
                raise card.error("T1 to T4 are not modelled; give the thickness in PSHELL")
            rows.append(plate)
        if not rows:
            return element()
        thickness, young, ratio, density = np.array(rows).T
        nodes = np.array(corners, dtype=np.int64)
        points = np.array(self.points)[nodes]
        self.own_mass += float(np.linalg.norm(area_vectors(points), axis=1) @ (thickness * density))
        return element(
            nodes=nodes,
            youngs_modulus=young,
            density=density,
            thickness=thickness,
            poisson_ratio=ratio,
            group=np.zeros(len(nodes), dtype=np.int64),
            kind=np.full(len(nodes), "wall", dtype="<U24"),
        )

    def _shape(self, card: Card) -> tuple[SectionFigures, float]:
        """Figures of PBARL and PBEAML, and their mass per length beside the material's."""
        shape = card.text(3).upper()
        if shape not in _SHAPES:
            raise card.error(f"{shape!r} is none of {', '.join(_SHAPES)}; write PBAR")
        count, figures = _SHAPES[shape]
        sides = [self.length * card.real(8 + k) for k in range(count)]
        second = 9 + count  # where the other end of a beam begins
        for k in range(count if card.text(second) else 0):
            if self.length * card.real(second + 2 + k, card.real(8 + k)) != sides[k]:
                raise card.error("a tapered beam is not modelled; give it a mean section")
        try:
            return figures(*sides), card.real(8 + count, 0.0)
        except ValueError:
            raise card.error(f"its dimensions make no {shape}; correct them") from None

    def _section(self, card: Card) -> tuple[SectionFigures, float, float, float, float, bool]:
        """Figures, product of inertia (m4), modulus, ratio, density; whether the axes turn."""
        product = 0.0
        if card.name in ("PBARL", "PBEAML"):
            figures, extra = self._shape(card)
        else:
            shear = [0.0, 0.0]
            if card.name == "PROD":
                area, torsion, extra = card.real(2), card.real(3, 0.0), card.real(5, 0.0)
                first = second = 0.0
            elif card.name == "PBAR":
                area, first, second, torsion, extra = (card.real(k, 0.0) for k in range(2, 7))
                shear = [card.real(16, 0.0), card.real(17, 0.0)]
                product = card.real(18, 0.0)
            else:
                area, first, second, product, torsion, extra = (
                    card.real(k, 0.0) for k in range(2, 8)
                )
                shear = _uniform(card)
            if not area > 0.0 or min(first, second, torsion, *shear, extra) < 0.0:
                raise card.error("the area must be positive and nothing negative; correct it")
            if card.name != "PROD" and not (first and second and torsion):
                self.changes["sections without bending or torsion: a little of it"] += 1
            first, second = first or _LITTLE * area**2, second or _LITTLE * area**2
            torsion = torsion or _TWIST * (first + second)
            square = self.length**2
            figures = SectionFigures(
                area=area * square,
                shear_area_y=shear[1] * area * square or np.inf,
                shear_area_z=shear[0] * area * square or np.inf,
                inertia_y=first * square**2,
                inertia_z=second * square**2,
                torsion_constant=torsion * square**2,
            )
            product *= square**2
        young, ratio, share, density = self.material(card.whole(1), card)
        if share != 1.0:  # the beam's G follows from E and nu
            figures = replace(
                figures,
                shear_area_y=share * figures.shear_area_y,
                shear_area_z=share * figures.shear_area_z,
                torsion_constant=share * figures.torsion_constant,
            )
        density += extra * self.mass / self.length / figures.area
        return figures, product, young, ratio, density, card.name == "PROD"

    def beams(self) -> Beams:
        """All bars, beams and rods."""
        points = np.array(self.points)
        rows, nodes, ups, offsets, released = [], [], [], [], []
        for card in self.deck.of("CBAR", "CBEAM", "CROD"):
            rod = card.name == "CROD"
            allowed = _LINES[-1:] if rod else _LINES[:-1]
            section = self.section(self._property(card, allowed))
            ends = [self.node(card, 2), self.node(card, 3)]
            arms, pins = np.zeros((2, 3)), np.zeros(12, dtype=np.bool_)
            if rod:
                pins[[4, 5, 10, 11]] = True
            else:
                for end in range(2):
                    arm = [card.real(10 + 3 * end + k, 0.0) for k in range(3)]
                    arms[end] = self.length * np.array(arm) @ self.turns.get(ends[end], np.eye(3))
                    which = np.array(card.components(8 + end), dtype=np.int64) + 6 * end
                    pins[_OURS[which]] = True
                if card.text(7).upper() not in ("", "GGG"):
                    raise card.error("offsets in the element's axes are not known; write GGG")
            axis = points[ends[1]] + arms[1] - points[ends[0]] - arms[0]
            size = float(np.linalg.norm(axis))
            if not size > LEVEL**2:
                raise card.error(f"it has no length at {place(points[ends[0]])}; move a node")
            up = self._up(card, ends, points, arms, axis / size)
            figures, product = section[:2]
            if product:
                self.changes["bars with I12: turned into their principal axes"] += 1
                figures, up = _principal(figures, product, up, axis / size)
            rows.append((*section[2:5], figures))
            nodes.append(ends)
            ups.append(up)
            offsets.append(arms)
            released.append(pins)
            self.own_mass += size * figures.area * section[4]
        if not rows:
            return Beams()
        young, ratio, density = np.array([row[:3] for row in rows]).T
        named = ("area", "shear_area_y", "shear_area_z", "inertia_y", "inertia_z")
        filled = {
            name: np.array([getattr(row[3], name) for row in rows])
            for name in (*named, "torsion_constant")
        }
        return Beams(
            nodes=np.array(nodes, dtype=np.int64),
            youngs_modulus=young,
            poisson_ratio=ratio,
            density=density,
            group=np.zeros(len(rows), dtype=np.int64),
            kind=np.full(len(rows), "beam", dtype="<U24"),
            up=np.array(ups),
            size=np.array([row[3].size for row in rows]),
            offset=np.array(offsets) if np.any(offsets) else None,
            released=np.array(released) if np.any(released) else None,
            **filled,
        )

    def _up(self, card: Card, ends: list[int], points: Floats, arms: Floats, x: Floats) -> Floats:
        """Unit vector across a line: its y axis in Nastran, its z axis here."""
        if card.name == "CROD":
            up = np.eye(3)[int(np.abs(x).argmin())]
        elif card.text(4) and not card.text(5) and "." not in card.text(4):
            up = points[self.node(card, 4)] - points[ends[0]] - arms[0]
        else:
            given = np.array([card.real(4 + k, 0.0) for k in range(3)])
            up = given @ self.turns.get(ends[0], np.eye(3))
        across = up - (up @ x) * x
        if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(up):
            raise card.error("its orientation is missing or along its axis; give X1, X2, X3")
        return np.asarray(across / np.linalg.norm(across))

    def links(self) -> RigidLinks:
        """Master, slave and what is tied of every RBE2 and of masses that stand off."""
        found = [(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 6), bool))]
        for card in self.deck.of("RBE2"):
            master, tied = self.node(card, 1), card.components(2)
            # A real in the last place is a coefficient of thermal expansion.
            last = max(k for k, text in enumerate(card.data) if text)
            card = replace(card, data=card.data[:last]) if "." in card.text(last) else card
            for grid in card.numbers(3):
                if grid not in self.number:
                    raise card.error(f"there is no GRID {grid}; add it or correct the number")
                slave, flags = self.number[grid], np.zeros((1, 6), dtype=np.bool_)
                flags[0, self.directions(card, slave, tied)] = True
                found.append((np.array([master]), np.array([slave]), flags))
        for card in self.deck.of("CONM2"):
            arm = self._arm(card)
            if np.linalg.norm(arm) > LEVEL**2:
                master = self.node(card, 1)
                self.points.append(self.points[master] + arm)
                tied_all = np.ones((1, 6), dtype=np.bool_)
                found.append((np.array([master]), np.array([len(self.points) - 1]), tied_all))
                self.changes["CONM2 off their nodes: at the end of a rigid arm"] += 1
        return RigidLinks(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _arm(self, card: Card) -> Floats:
        given = np.array([card.real(4 + k, 0.0) for k in range(3)])
        if card.whole(2, 0) == -1:
            place_of = self.points[self.node(card, 1)]
            return self.length * given - place_of
        return np.asarray(self.length * given @ self.deck.system(card.whole(2, 0), card)[1])

    def masses(self) -> PointMasses:
        """All CONM2; those that stand off are at points behind the grid, in their order."""
        nodes, values, inertia, behind = [], [], [], len(self.number)
        for card in self.deck.of("CONM2"):
            node = self.node(card, 1)
            if np.linalg.norm(self._arm(card)) > LEVEL**2:
                node, behind = behind, behind + 1
            i11, i21, i22, i31, i32, i33 = (card.real(8 + k, 0.0) for k in range(6))
            whole = np.array([[i11, -i21, -i31], [-i21, i22, -i32], [-i31, -i32, i33]])
            axes = self.deck.system(max(card.whole(2, 0), 0), card)[1]
            whole = axes.T @ whole @ axes
            if np.abs(whole - np.diag(np.diag(whole))).max() > 1e-6 * np.abs(whole).max():
                self.changes["CONM2 with products of inertia, which are left out"] += 1
            if card.real(3) < 0.0 or np.diag(whole).min() < 0.0:
                raise card.error("a mass and its inertia cannot be negative; correct them")
            nodes.append(node)
            values.append(card.real(3) * self.mass)
            inertia.append(np.diag(whole) * self.mass * self.length**2)
        self.own_mass += sum(values)
        if not nodes:
            return PointMasses()
        return PointMasses(np.array(nodes, dtype=np.int64), np.array(values), np.array(inertia))

    def springs(self) -> Springs:
        """All CELAS2."""
        pairs, ways, values = [], [], []
        for card in self.deck.of("CELAS2"):
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
            pairs.append([first, joined[1][0] if len(joined) > 1 else -1])
            ways.append(direction)
            scale = self.force * self.length ** (-1 if direction < 3 else 1)
            values.append(card.real(1) * scale)
        if not pairs:
            return Springs()
        group = np.full(len(pairs), CONSTANT, dtype=np.int64)
        return Springs(np.array(pairs), np.array(ways), np.array(values), group)

    def fixed(self) -> Flags:
        """What SPC, SPC1 and the permanent constraints of GRID hold, (nodes, 6)."""
        cards = self.deck.of("SPC", "SPC1")
        sets = sorted({card.whole(0) for card in cards})
        sums = {card.whole(0): card for card in self.deck.of("SPCADD")}
        chosen = self.deck.chosen
        if chosen is None and len(sets) > 1 and len(sums) != 1:
            raise cards[0].error(
                f"there are sets {', '.join(map(str, sets))}, and no SPC = in case control; keep "
                "one, or write SPC = before BEGIN BULK"
            )
        if chosen is None:
            chosen = next(iter(sums or sets), 0)
        used = set(sums[chosen].numbers(1)) if chosen in sums else {chosen}
        fixed = np.zeros((len(self.number), DOF_PER_NODE), dtype=np.bool_)

        def hold(card: Card, node: int, number: int) -> None:
            fixed[node, self.directions(card, node, card.components(number))] = True

        for card in cards:
            if card.whole(0) not in used:
                self.skipped[f"{card.name} of another set"] += 1
            elif card.name == "SPC1":
                through = any(text.upper() == "THRU" for text in card.data)
                for grid in card.numbers(2):
                    if grid in self.number:
                        hold(card, self.number[grid], 1)
                    elif not through:
                        raise card.error(f"there is no GRID {grid}; add it or correct the number")
            else:
                for k in (k for k in (1, 4) if card.text(k)):
                    hold(card, self.node(card, k), k + 1)
        for card in self.deck.of("GRID"):
            if card.text(6):
                hold(card, self.number[card.whole(0)], 6)
        return fixed

    def notes(self, model: FiniteElementModel, levels: Floats | None) -> list[str]:
        """What was taken, changed and left out."""
        gone = {n: c for n, c in (self.deck.left_out | self.skipped).items() if c}
        for name, cards in self.deck.cards.items():
            if name not in TAKEN and name not in gone:
                gone[name] = len(cards)
        missing: Counter[str] = Counter()
        for text, count in gone.items():
            missing[text.split()[0]] += count
        counts = {name: len(self.deck.cards.get(name, ())) - missing[name] for name in TAKEN}
        taken = [f"{count} {name}" for name, count in counts.items() if count]
        total = sum(float(b.mass(model.nodes).sum()) for b in model.elements)
        total += float(model.masses.mass.sum())
        kinds = Counter(str(kind) for block in model.elements for kind in block.kind.tolist())
        notes = [
            f"Taken: {', '.join(taken)}.",
            f"They are {', '.join(f'{count} {kind}' for kind, count in kinds.items())} elements.",
            f"Mass of the file {self.own_mass / 1e3:.6g} t, of the model {total / 1e3:.6g} t.",
            *(f"Changed: {count} {what}." for what, count in self.changes.items()),
        ]
        if gone:
            listed = ", ".join(f"{count} {name}" for name, count in sorted(gone.items()))
            notes.append(f"Left out: {listed}.")
        if levels is not None:
            heights = ", ".join(f"{level:.4g}" for level in levels)
            notes.append(f"Floors at {heights} m above the base.")
        return notes


def _box(width: float, depth: float, flange: float, web: float) -> SectionFigures:
    inner, clear = width - 2.0 * web, depth - 2.0 * flange
    if min(inner, clear, flange, web) <= 0.0:
        raise ValueError
    between = (width - web) ** 2 * (depth - flange) ** 2
    around = width * web + depth * flange - web**2 - flange**2
    return SectionFigures(
        area=width * depth - inner * clear,
        shear_area_y=5.0 / 3.0 * width * flange,
        shear_area_z=5.0 / 3.0 * depth * web,
        inertia_y=(width * depth**3 - inner * clear**3) / 12.0,
        inertia_z=(depth * width**3 - clear * inner**3) / 12.0,
        torsion_constant=2.0 * flange * web * between / around,
        extent=(width, depth),
    )


def _i(h: float, low: float, high: float, web: float, below: float, above: float) -> SectionFigures:
    if low != high or below != above:
        raise ValueError
    return ISection(
        shape="I", width=low, depth=h, web_thickness=web, flange_thickness=below
    ).figures()


# Sections of PBARL and PBEAML: how many sides they have, and their figures.
_SHAPES: dict[str, tuple[int, Callable[..., SectionFigures]]] = {
    "ROD": (1, lambda r: CircleSection(shape="circle", diameter=2.0 * r).figures()),
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
    "BOX": (4, _box),
}


def _uniform(card: Card) -> list[float]:
    """Shear factors of a PBEAM, which must have one section and its axis on the line."""
    at = 16
    while card.text(at).upper() in ("YES", "YESA", "NO"):
        for k in range(2, 8):
            if abs(card.real(at + k, card.real(k, 0.0)) - card.real(k, 0.0)) > 0.0:
                raise card.error("a tapered beam is not modelled; give it a mean section")
        at += 16 if card.text(at).upper() == "YES" else 8
    if any(card.real(at + 8 + k, 0.0) for k in range(4)):
        raise card.error("a neutral axis off the line (N1, N2) is not modelled; offset the beam")
    return [card.real(at, 1.0), card.real(at + 1, 1.0)]


def _principal(
    figures: SectionFigures, product: float, up: Floats, x: Floats
) -> tuple[SectionFigures, Floats]:
    """A section about its principal axes, and the direction of its depth."""
    tensor = np.array([[figures.inertia_y, product], [product, figures.inertia_z]])
    values, vectors = np.linalg.eigh(tensor)
    first = int(np.abs(vectors[0]).argmax())
    turned = vectors[0, first] * up + vectors[1, first] * np.cross(x, up)
    inertia = float(values[first]), float(values[1 - first])
    if min(inertia) <= 0.0:
        raise BuildingError(f"a section's I12 {product:.4g} m4 is too large for I1 and I2")
    return replace(figures, inertia_y=inertia[0], inertia_z=inertia[1]), turned


def _told(block: Elements, points: Floats, tops: Floats) -> Elements:
    """Elements with their story and kind."""
    corners = points[block.nodes]
    kind = cell_kinds(corners)
    if corners.shape[1] == 2:
        axis = corners[:, 1] - corners[:, 0]
        rise = np.abs(axis[:, 2]) / np.maximum(np.linalg.norm(axis, axis=1), 1e-300)
        kind = np.where((kind == "beam") & (rise > 0.3), "brace", kind).astype("<U24")
    group = np.searchsorted(tops, corners.mean(axis=1)[:, 2] - LEVEL)
    return replace(block, kind=kind, group=np.minimum(group, len(tops) - 1).astype(np.int64))


def _used(model: FiniteElementModel, deck: Deck) -> tuple[FiniteElementModel, Integers]:
    """The model without nodes that nothing uses, and the numbers of its nodes in the deck."""
    links, springs, masses = model.links, model.springs, model.masses
    joined = [block.nodes.ravel() for block in model.elements]
    joined += [links.master, links.slave, springs.nodes[springs.nodes >= 0]]
    used = np.unique(np.concatenate(joined))
    alone = np.flatnonzero(~np.isin(masses.node, used))
    if len(alone):
        card = deck.of("CONM2")[int(alone[0])]
        raise card.error("its node belongs to no element or RBE2, so it carries nothing; join it")
    number = np.zeros(len(model.nodes) + 1, dtype=np.int64)
    number[used] = np.arange(len(used))
    number[-1] = -1  # the ground
    model = FiniteElementModel(
        nodes=model.nodes[used],
        fixed=model.fixed[used],
        groups=model.groups,
        elements=tuple(replace(block, nodes=number[block.nodes]) for block in model.elements),
        masses=replace(masses, node=number[masses.node]),
        springs=replace(springs, nodes=number[springs.nodes]),
        links=replace(links, master=number[links.master], slave=number[links.slave]),
    )
    names = np.zeros(used[-1] + 1, dtype=np.int64)  # 0 for the ends of arms
    grids = [card.whole(0) for card in deck.of("GRID")][: len(names)]
    names[: len(grids)] = grids
    return model, names[used]


def _stiff(model: FiniteElementModel) -> Flags:
    """Directions of nodes (N, 6) in which something is stiff: pins alone hold no rotation."""
    stiff = np.zeros((len(model.nodes), DOF_PER_NODE), dtype=np.bool_)
    for block in model.elements:
        stiff[block.nodes.ravel(), :3] = True
        pins = block.released if isinstance(block, Beams) else None
        for end, nodes in enumerate(block.nodes.T):
            free: Flags = np.zeros(len(block), dtype=np.bool_)
            if pins is not None:  # both bending moments; the torsion is about the axis
                free = pins[:, 6 * end + 4] & pins[:, 6 * end + 5]
                points = model.nodes[block.nodes]
                axis = np.abs(points[:, 1] - points[:, 0])
                turned = axis > 0.9 * np.linalg.norm(axis, axis=1, keepdims=True)
                np.logical_or.at(stiff[:, 3:], nodes, turned & ~pins[:, [6 * end + 3]])
            stiff[nodes[~free]] = True
    for end in range(2):
        there = model.springs.nodes[:, end] >= 0
        stiff[model.springs.nodes[there, end], model.springs.direction[there]] = True
    links = model.links
    arms = rigid_arms(model.nodes[links.slave] - model.nodes[links.master]) != 0.0
    moves = (arms & links.tied[:, :, None]).any(axis=1)
    np.logical_or.at(stiff, links.master, moves)
    stiff[links.slave] |= links.tied
    return stiff


def _check(model: FiniteElementModel, held: Integers, names: Integers, file: str) -> None:
    """Refuse flat, double and hanging shells, and what has no way to the ground."""
    if not len(held):
        raise BuildingError(f"{file}: no node is held; add an SPC1 at the base")
    surfaces = {block.cell_type: block.nodes for block in model.elements if block.dimension() == 2}
    try:
        if surfaces:
            check_elements(model.nodes, surfaces, doubles_allowed=True, names=names)
    except Complaint as complaint:
        raise BuildingError(f"{file}: {complaint}") from None
    pairs = [np.stack([model.links.master, model.links.slave], axis=1)]
    pairs += [model.springs.nodes[model.springs.nodes[:, 1] >= 0]]
    cells = [*(block.nodes for block in model.elements), *pairs]
    pieces = loose_pieces(len(model.nodes), cells, held)
    if pieces:
        where = place(model.nodes[pieces[0][0]])
        raise BuildingError(
            f"{file}: {len(pieces)} parts hang free, such as {len(pieces[0])} nodes around "
            f"{where}; join their nodes to the others, or remove them"
        )


def _walls(model: FiniteElementModel) -> tuple[tuple[str, ...], tuple[Integers, ...]]:
    """Walls W1, W2, ... from the lowest place in plan on: shells of one plane that touch."""
    blocks = [b for b in model.elements if b.dimension() == 2]
    faces = np.concatenate([b.nodes[:, [0, 1, 2, -1]] for b in blocks] or [np.zeros((0, 4), int)])
    kinds = np.concatenate([b.kind for b in blocks] or [np.zeros(0, dtype="<U24")])
    upright = np.flatnonzero(kinds == "wall")
    owner = np.full(len(faces), -1)
    if len(upright):
        normal = area_vectors(model.nodes[faces[upright]])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        sides = np.stack([faces[upright], np.roll(faces[upright], -1, axis=1)], axis=-1)
        sides = np.sort(sides.reshape(-1, 2), axis=1)
        _, side = np.unique(sides, axis=0, return_inverse=True)
        shell = np.repeat(np.arange(len(upright)), 4)
        turn = np.round([normal[:, 0] ** 2, normal[:, 0] * normal[:, 1]], 1)[:, shell]
        order = np.lexsort([*turn, side.ravel()])  # shells of one plane side by side
        shell = shell[order]
        met = np.flatnonzero(np.diff(side.ravel()[order]) == 0)
        pairs = np.stack([shell[met], shell[met + 1]], axis=1)
        flat = np.abs(np.einsum("nd,nd->n", *normal[pairs].swapaxes(0, 1))) > _SAME_PLANE
        first, second = pairs[flat].T
        graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(upright),) * 2)
        count, piece = connected_components(graph, directed=False)
        middle = model.nodes[faces[upright]].mean(axis=1)
        lowest = np.array([middle[piece == k].mean(axis=0).round(3) for k in range(count)])
        rank = np.empty(count, dtype=np.int64)
        rank[np.lexsort(lowest.T[[2, 0, 1]])] = np.arange(count)
        owner[upright] = rank[piece]
    names = tuple(f"W{k + 1}" for k in range(owner.max(initial=-1) + 1))
    parts = np.split(owner, np.cumsum([len(b) for b in blocks])[:-1]) if blocks else []
    by_block = dict(zip(map(id, blocks), parts, strict=True))
    nothing = [np.full(len(b), -1) for b in model.elements]
    return names, tuple(
        by_block.get(id(b), none) for b, none in zip(model.elements, nothing, strict=True)
    )
