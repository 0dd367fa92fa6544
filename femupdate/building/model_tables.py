"""What the readers of other programs' models fill, and the building's model that it becomes.

Nothing is dropped without a word: a reader counts what it takes, changes and leaves out.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from femupdate.arrays import Flags, Floats, Integers, Strings
from femupdate.building.building_mesh import diaphragm_links
from femupdate.building.entry import ALL, Complaint
from femupdate.building.kinds import MeshBuilding
from femupdate.building.mesh_check import LEVEL, cell_kinds, check_elements, loose_pieces, place
from femupdate.building.sections import SectionFigures
from femupdate.errors import BuildingError
from femupdate.fe.elements.beam import Beams
from femupdate.fe.elements.shell import Shells
from femupdate.fe.elements.triangle import Triangles
from femupdate.fe.links import rigid_arms
from femupdate.fe.model import (
    CONSTANT,
    DOF_PER_NODE,
    Elements,
    FiniteElementModel,
    PointMasses,
    RigidLinks,
    Springs,
    area_vectors,
)
from femupdate.storage import LARGEST_BYTES, check_regular

# Of sections that give none: bending over the area squared, torsion over bending.
_LITTLE, _TWIST = 1e-4, 1e-2
_SURFACES = {4: Shells, 3: Triangles}
_WHOLE_BODY = np.ones(DOF_PER_NODE, dtype=np.bool_)


K = TypeVar("K")
T = TypeVar("T")


class Record(Protocol):
    """An entry of a file, which complains with its file and line."""

    def error(self, text: str) -> BuildingError:
        """A complaint; the text says what is wrong and how to mend it."""


R = TypeVar("R", bound=Record)


@dataclass(frozen=True)
class ModelFile(ABC, Generic[R]):
    """A model of another program, parsed: one class for each program."""

    program: ClassVar[str]
    node_kind: ClassVar[str]  # how its nodes are called
    what: ClassVar[str]  # how its entries are called, such as "cards"
    mends: ClassVar[Mapping[str, str]]  # what to do about some of the unknown kinds

    file: Path
    entries: Mapping[str, Sequence[R]]  # by their kind

    @property
    @abstractmethod
    def unknown(self) -> list[str]:
        """Kinds of entries that have no counterpart here."""

    @abstractmethod
    def fill(self, tables: "ModelTables") -> None:
        """Fill the tables; BuildingError for an entry that cannot be."""

    @property
    def units(self) -> tuple[str, str] | None:
        """Units of force and length that the file states; None where it states none."""
        return None

    @property
    def materials(self) -> list[tuple[float, float]]:
        """Young's modulus and density in the file's units, where these are to be told by them."""
        return []

    @property
    def left_out(self) -> Mapping[str, int]:
        """How many entries of each kind modes do not depend on."""
        return {}

    @property
    def lacks(self) -> tuple[str, ...]:
        """What such a file never says and a building file must: keys of `Said`."""
        return ()

    @property
    def unsized(self) -> Sequence[str]:
        """Sections that the file names without their figures."""
        return ()

    @property
    def counts(self) -> Mapping[str, int]:
        """How many entries of each kind there are."""
        return {kind: len(rows) for kind, rows in self.entries.items() if rows}

    def of(self, *kinds: str) -> list[R]:
        """All entries of some kinds."""
        return [row for kind in kinds for row in self.entries.get(kind, ())]


def known(user: Record, rows: Mapping[K, T], name: K, what: str) -> T:
    """What an entry names; BuildingError where it is not there."""
    if name not in rows:
        raise user.error(f"there is no {what} {name}; add it or correct the name")
    return rows[name]


@dataclass(frozen=True)
class Said:
    """What a building file adds to a model."""

    ignored: tuple[str, ...] = ()  # kinds of entries that are left out on the user's word
    elastic: tuple[str, ...] = ()  # nonlinear ones that are taken at their initial stiffness
    mass: str | None = None  # "lumped" or "consistent", of elements
    diaphragms: tuple[int, ...] | None = None  # numbers of floors that are rigid in plan
    infills: float = 0.0  # Pa, below which diagonals are struts of infills
    base: str | None = None  # "fixed" or "pinned", where the file says nothing
    # that the file only names
    sections: Mapping[str, SectionFigures] = field(default_factory=dict)


@dataclass(frozen=True)
class Stuff:
    """A material in SI."""

    young: float
    ratio: float
    density: float
    shear_share: float = 1.0  # its shear modulus over that of the two


def file_text(file: Path) -> str:
    """The text of a model, in UTF-8 or latin-1; BuildingError for what is no plain text."""
    check_regular(file, BuildingError)
    if file.stat().st_size > LARGEST_BYTES:
        size = file.stat().st_size / 1e6
        raise BuildingError(f"{file.name}: {size:.0f} MB are too many; coarsen it")
    content = file.read_bytes()
    if b"\x00" in content:
        line = content[: content.index(b"\x00")].count(b"\n") + 1
        raise BuildingError(
            f"{file.name}, line {line}: this is no plain text (UTF-16, or a binary file); save "
            "it as ASCII or UTF-8"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


class ModelTables:
    """Nodes, frames, areas, restraints, links and masses of a file, which come in its own units.

    Sections and materials come in SI, in the frames and areas that have them.
    """

    def __init__(self, file: ModelFile[Any], length: float, force: float, said: Said) -> None:
        """Make empty tables.

        Args:
            length: m in the file's unit of length.
            force: N in its unit of force.
        """
        self.file, self.length, self.force, self.said = file, length, force, said
        self.mass = force / length  # kg in the file's unit
        self.stress = force / length**2
        self.number: dict[str, int] = {}
        self.points: list[Floats] = []  # m; those of offset masses have no name
        self.levels: dict[str, float] = {}  # stories that the file names: their tops, m
        self.lines: list[
            tuple[Record, list[int], SectionFigures, Stuff, Floats, Floats, Flags]
        ] = []
        self.areas: list[tuple[list[int], tuple[float, float, float, float]]] = []
        self.holds: list[tuple[int, list[int]]] = []
        self.ties: list[tuple[Record, int, int, Flags]] = []
        self.bodies: list[Integers] = []  # nodes of diaphragms
        self.weights: list[tuple[Record, int, Floats]] = []
        self.springs: list[tuple[int, int, int, float, float]] = []
        self.changes: Counter[str] = Counter()
        self.skipped: Counter[str] = Counter()  # whose first word is the kind of the entry
        self.own_mass = 0.0

    def node(self, name: str, point: Floats) -> int:
        """Add a node at a point in the file's units."""
        self.number[name] = len(self.points)
        self.points.append(self.length * np.asarray(point, dtype=np.float64))
        return self.number[name]

    def find(self, user: Record, name: str) -> int:
        """The number of a node that an entry names."""
        return known(user, self.number, name, self.file.node_kind)

    def material(
        self, user: Record, young: float, ratio: float, density: float, shear: float = 0.0
    ) -> Stuff:
        """A material from figures in the file's units; no shear modulus follows from the two."""
        if not young > 0.0 or not 0.0 <= ratio < 0.5 or density < 0.0:
            raise user.error(
                "E must be positive, NU from 0 to below .5, RHO not negative; correct it"
            )
        share = shear / (0.5 * young / (1.0 + ratio)) if shear else 1.0
        share = 1.0 if abs(share - 1.0) < 1e-4 else share
        return Stuff(young * self.stress, ratio, density * self.mass / self.length**3, share)

    def section(
        self,
        user: Record,
        area: float,
        bending: Sequence[float],
        torsion: float,
        shear: Sequence[float],
        *,
        rod: bool = False,
    ) -> SectionFigures:
        """A section from figures in the file's units.

        Args:
            bending: second moments for motion along the depth and along the width.
            shear: areas along the depth and along the width; 0 for no shear deformation.
            rod: whether it is no mistake that it does not bend.
        """
        if not area > 0.0 or min(*bending, torsion, *shear) < 0.0:
            raise user.error("the area must be positive and nothing negative; correct it")
        if not rod and not (bending[0] and bending[1] and torsion):
            self.changes["sections without bending or torsion: a little of it"] += 1
        first, second = (value or _LITTLE * area**2 for value in bending)
        square = self.length**2
        return SectionFigures(
            area=area * square,
            shear_area_y=shear[1] * square or np.inf,
            shear_area_z=shear[0] * square or np.inf,
            inertia_y=first * square**2,
            inertia_z=second * square**2,
            torsion_constant=(torsion or _TWIST * (first + second)) * square**2,
        )

    def line(
        self,
        user: Record,
        ends: list[int],
        figures: SectionFigures,
        stuff: Stuff,
        up: Floats,
        *,
        pins: Flags | None = None,
        arms: Floats | None = None,
        line_mass: float | None = None,
    ) -> None:
        """Add a frame.

        Args:
            up: direction of the section's depth, any that is not along the axis.
            pins: (12,) which forces its ends do not pass on, as `Beams.released`.
            arms: (2, 3) rigid arms in global axes, m.
            line_mass: kg/m between the nodes; of the material and the area where None.
        """
        arms = np.zeros((2, 3)) if arms is None else arms
        pins = np.zeros(12, dtype=np.bool_) if pins is None else pins
        span = self.points[ends[1]] - self.points[ends[0]]
        axis = span + arms[1] - arms[0]
        size = float(np.linalg.norm(axis))
        if not size > LEVEL**2:
            where = place(self.points[ends[0]])
            raise user.error(f"it has no length at {where}; move a node or remove it")
        across = up - (up @ axis) * axis / size**2
        if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(up):
            raise user.error("its orientation is missing or along its axis; give X1, X2, X3")
        up = across / np.linalg.norm(across)
        shears, moments = pins[[[1, 7], [2, 8]]], pins[[[5, 11], [4, 10]]]  # of both planes
        sideways = shears.all(axis=1) | (shears.sum(axis=1) + moments.sum(axis=1) > 2)
        if pins[[0, 6]].all() or pins[[3, 9]].all() or sideways.any():
            raise user.error("it is released so far that it moves freely; keep one end fixed")
        if stuff.shear_share != 1.0:  # the beam's G follows from E and nu
            share = stuff.shear_share
            figures = replace(
                figures,
                shear_area_y=share * figures.shear_area_y,
                shear_area_z=share * figures.shear_area_z,
                torsion_constant=share * figures.torsion_constant,
            )
        if line_mass is not None:
            whole = line_mass * float(np.linalg.norm(span))
            stuff = replace(stuff, density=whole / size / figures.area)
        self.own_mass += size * figures.area * stuff.density
        self.lines.append((user, ends, figures, stuff, up, arms, pins))

    def area(
        self,
        user: Record,
        corners: list[int],
        stuff: Stuff,
        thickness: float,
        *,
        bending: float = 1.0,
        membrane: float = 1.0,
        area_mass: float | None = None,
    ) -> None:
        """Add a shell.

        Args:
            thickness: m.
            bending, membrane: factors on the two stiffnesses.
            area_mass: kg/m2; of the material and thickness where None.
        """
        if len(corners) not in _SURFACES or len(set(corners)) < len(corners):
            count = len(set(corners))
            raise user.error(f"it has {count} distinct corners; divide it into 3- and 4-sided ones")
        if not min(thickness, bending, membrane) > 0.0:
            raise user.error("thickness and stiffness must be positive; correct them")
        # The shell whose membrane and bending are both as given.
        factor = 1.0 if bending == membrane else float(np.sqrt(bending / membrane))
        if factor != 1.0:
            self.changes["shells with another bending stiffness: an equivalent thickness"] += 1
        mass = stuff.density * thickness if area_mass is None else area_mass
        young = stuff.young * membrane / factor
        plate = (thickness * factor, young, stuff.ratio, mass / (thickness * factor))
        points = np.array([self.points[k] for k in corners])
        self.own_mass += mass * float(np.linalg.norm(area_vectors(points[None])))
        self.areas.append((corners, plate))

    def tie(self, user: Record, master: int, slave: int, tied: Flags = _WHOLE_BODY) -> None:
        """Let a node follow another one as a rigid body in some directions."""
        self.ties.append((user, master, slave, tied))

    def spring(
        self, first: int, second: int, direction: int, stiffness: float, damping: float = 0.0
    ) -> None:
        """Add a spring and a dashpot, in the file's units; -1 is the ground."""
        scale = self.force * self.length ** (-1 if direction < 3 else 1)
        self.springs.append((first, second, direction, stiffness * scale, damping * scale))

    def point_mass(
        self, user: Record, node: int, mass: Sequence[float] | Floats, inertia: Floats
    ) -> None:
        """Add a mass (kg along x, y and z) with inertia (kg m2 about them)."""
        values = np.array([*mass, *inertia], dtype=np.float64)
        if not (values >= 0.0).all():
            raise user.error("a mass and its inertia cannot be negative; correct them")
        self.own_mass += values[0]
        self.weights.append((user, node, values))

    def divide_lines(self) -> None:
        """Divide frames at the nodes on them, as SAP2000 and ETABS do."""
        tree, points = cKDTree(np.array(self.points)), np.array(self.points)
        whole, self.lines = self.lines, []
        for user, ends, figures, stuff, up, arms, pins in whole:
            first, last = points[ends]
            axis, size = last - first, float(np.linalg.norm(last - first))
            near = np.array(tree.query_ball_point(0.5 * (first + last), 0.5 * size - LEVEL))
            on = near
            if len(near):
                along = (points[near] - first) @ axis / size**2
                away = np.linalg.norm(points[near] - first - along[:, None] * axis, axis=1)
                on = near[away < LEVEL][np.argsort(along[away < LEVEL])]
            nodes = [ends[0], *on.tolist(), ends[1]]
            if len(on):
                self.changes["frames divided at the joints on them"] += 1
            for k, pair in enumerate(pairwise(nodes)):
                here, free = np.zeros((2, 3)), np.zeros(12, dtype=np.bool_)
                if k == 0:
                    here[0], free[:6] = arms[0], pins[:6]
                if k == len(nodes) - 2:
                    here[1], free[6:] = arms[1], pins[6:]
                self.lines.append((user, list(pair), figures, stuff, up, here, free))

    def _beams(self) -> Beams:
        if not self.lines:
            return Beams()
        _, nodes, figures, stuff, ups, offsets, released = zip(*self.lines, strict=True)
        named = [item.name for item in fields(SectionFigures) if item.name != "extent"]
        return Beams(
            nodes=np.array(nodes, dtype=np.int64),
            youngs_modulus=np.array([each.young for each in stuff]),
            poisson_ratio=np.array([each.ratio for each in stuff]),
            density=np.array([each.density for each in stuff]),
            group=np.zeros(len(nodes), dtype=np.int64),
            kind=np.full(len(nodes), "beam", dtype="<U24"),
            up=np.array(ups),
            size=np.array([each.size for each in figures]),
            offset=np.array(offsets) if np.any(offsets) else None,
            released=np.array(released) if np.any(released) else None,
            **{name: np.array([getattr(each, name) for each in figures]) for name in named},
        )

    def _blocks(self) -> list[Elements]:
        blocks: list[Elements] = []
        for count, element in _SURFACES.items():
            rows = [row for row in self.areas if len(row[0]) == count]
            if rows:
                thickness, young, ratio, density = np.array([plate for _, plate in rows]).T
                blocks.append(
                    element(
                        nodes=np.array([corners for corners, _ in rows], dtype=np.int64),
                        youngs_modulus=young,
                        density=density,
                        thickness=thickness,
                        poisson_ratio=ratio,
                        group=np.zeros(len(rows), dtype=np.int64),
                        kind=np.full(len(rows), "wall", dtype="<U24"),
                    )
                )
        beams = self._beams()
        return [*blocks, beams] if len(beams) else blocks

    def model(self, building: MeshBuilding | None) -> tuple[FiniteElementModel, Strings]:
        """The model with its story groups, and the names of its nodes."""
        points, blocks = np.array(self.points), self._blocks()
        if not blocks:
            raise BuildingError(
                f"{self.file.file.name}: it has no shells, bars or beams; mesh the building"
            )
        for k, block in enumerate(blocks):  # which story they belong to, and what they are
            corners = points[block.nodes]
            kind = cell_kinds(corners)
            if corners.shape[1] == 2:
                axis = corners[:, 1] - corners[:, 0]
                rise = np.abs(axis[:, 2]) / np.maximum(np.linalg.norm(axis, axis=1), 1e-300)
                steep = (kind == "beam") & (rise > 0.3)
                soft = steep & (block.youngs_modulus < self.said.infills)
                kind = np.where(soft, "infill", np.where(steep, "brace", kind)).astype("<U24")
                self.changes["diagonals softer than mesh.infills: struts of infills"] += soft.sum()
            middle, group = corners.mean(axis=1), np.zeros(len(corners), dtype=np.int64)
            if building is not None:
                group = building.stories_at(middle)
                above = middle[:, 2] > building.floor_levels.max()
                group[above & building.is_chain] = len(building.stories) - 1
                if (group < 0).any():
                    lost = place(middle[int(group.argmin())])
                    text = f"{int((group < 0).sum())} elements lie in none, such as at {lost}"
                    raise Complaint("stories", f"{text}; widen x, y or the height of one")
            blocks[k] = replace(block, kind=kind, group=group)
        fixed = np.zeros((len(points), DOF_PER_NODE), dtype=np.bool_)
        for node, directions in self.holds:
            fixed[node, directions] = True
        values = np.array([row for _, _, row in self.weights]).reshape(-1, DOF_PER_NODE)
        where = np.array([node for _, node, _ in self.weights], dtype=np.int64)
        if self.said.mass == "lumped":
            lumped = np.zeros((len(points), DOF_PER_NODE))
            for k, block in enumerate(blocks):
                share = block.mass(points) / block.node_count()
                np.add.at(lumped[:, :3], block.nodes, share[:, None, None])
                blocks[k] = replace(block, density=np.zeros(len(block)))
            heavy = np.flatnonzero(lumped.any(axis=1))
            values, where = np.concatenate([values, lumped[heavy]]), np.concatenate([where, heavy])
        springs = Springs()
        if self.springs:
            first, second, way, stiffness, damping = zip(*self.springs, strict=True)
            group = np.full(len(first), CONSTANT, dtype=np.int64)
            pairs = np.stack([first, second], axis=1)
            dashpots = np.array(damping) if any(damping) else None
            springs = Springs(pairs, np.array(way), np.array(stiffness), group, dashpots)
        model = FiniteElementModel(
            nodes=points,
            fixed=fixed,
            groups=1 if building is None else len(building.stories),
            elements=tuple(blocks),
            masses=PointMasses(where, values[:, :3], values[:, 3:]),
            springs=springs,
        )
        self._check_ties(fixed)
        ties = [RigidLinks(np.array([m]), np.array([s]), t[None]) for _, m, s, t in self.ties]
        bodies, z = list(self.bodies), points[:, 2]
        if building is not None:
            levels, owner = building.floor_levels, building.stories_at(points)
            bodies += [
                np.flatnonzero((np.abs(z - levels[k]) < LEVEL) & (owner == k))
                for k in self.said.diaphragms or ()
            ]
        elif "mesh.diaphragms" in self.file.lacks:  # a draft must propose some
            carried = np.concatenate([block.nodes.ravel() for block in blocks])
            levels = np.unique(z[where[~np.isin(where, carried)]])
            bodies += [np.flatnonzero(np.abs(z - level) < LEVEL) for level in levels]
        links = RigidLinks().joined(*ties)
        plan = diaphragm_links(model, bodies, links.slave)
        return self._used(replace(model, links=links.joined(plan)))

    def _check_ties(self, fixed: Flags) -> None:
        """Refuse a node that is held or tied twice, and rings of ties."""
        name = {number: name for name, number in self.number.items()}
        above: dict[int, int] = {}
        taken = np.zeros_like(fixed)
        for user, master, slave, tied in self.ties:
            node = f"{self.file.node_kind} {name.get(slave)}"
            if (fixed[slave] & tied).any():
                raise user.error(f"{node} follows it and is held by a support; remove one of both")
            if (taken[slave] & tied).any():
                raise user.error(f"{node} follows two others; remove one of the two links")
            foot: int | None = master
            while foot is not None and foot != slave:
                foot = above.get(foot)
            if foot is not None:
                raise user.error(f"{node} follows itself, directly or by others; tie it to another")
            above[slave], taken[slave] = master, taken[slave] | tied

    def _used(self, model: FiniteElementModel) -> tuple[FiniteElementModel, Strings]:
        """The model without nodes that nothing uses."""
        links, springs, masses = model.links, model.springs, model.masses
        joined = [block.nodes.ravel() for block in model.elements]
        joined += [links.master, links.slave, springs.nodes[springs.nodes >= 0]]
        used = np.unique(np.concatenate(joined))
        alone = np.flatnonzero(~np.isin(masses.node, used))
        if len(alone):
            left = f" without {' and '.join(self.file.unknown)}" if self.file.unknown else ""
            text = f"its node is of no element or rigid body{left}, so it carries nothing; join it"
            raise self.weights[int(alone[0])][0].error(text)
        number = np.zeros(len(model.nodes) + 1, dtype=np.int64)
        number[used] = np.arange(len(used))
        number[-1] = -1  # the ground
        model = replace(
            model,
            nodes=model.nodes[used],
            fixed=model.fixed[used],
            elements=tuple(replace(block, nodes=number[block.nodes]) for block in model.elements),
            masses=replace(masses, node=number[masses.node]),
            springs=replace(springs, nodes=number[springs.nodes]),
            links=replace(links, master=number[links.master], slave=number[links.slave]),
        )
        names = np.full(len(self.points), "", dtype=object)
        names[list(self.number.values())] = list(self.number)
        self.skipped[f"{self.file.node_kind} that nothing uses"] = int(
            (np.delete(names, used) != "").sum()
        )
        names = names[used]
        called = np.array([f"{self.file.node_kind} {name}" if name else "" for name in names])
        return replace(model, names=called), names


@dataclass(frozen=True)
class ReadModel:
    """A model of another program in SI, and what became of its entries."""

    model: FiniteElementModel  # groups are stories
    held: Integers  # nodes that are held, or stand on springs
    walls: tuple[str, ...]  # names of the walls
    # which of them each element belongs to, -1 for none, one array a block of elements
    wall_of: tuple[Integers, ...]
    notes: tuple[str, ...]  # a sentence each
    levels: Mapping[str, float]  # tops of the stories that the file names, m
    base: float  # level in the file that is 0 here, m


def read_model(
    file: ModelFile[Any],
    length: float,
    force: float,
    said: Said,
    *,
    base: float | None = 0.0,
    building: MeshBuilding | None = None,
) -> ReadModel:
    """Return the model of a file.

    Args:
        length: m in the file's unit of length.
        force: N in its unit of force.
        base: level of the base, m; where None that of the lowest node, if the file holds none.
        building: which says the stories; all is one story where None.

    Raises:
        BuildingError: an entry is unknown, wrong or refers to what is not there, or a part of the
            mesh hangs in the air.
    """
    for name in file.unknown:
        if name not in said.ignored and said.ignored != ALL:
            mend = file.mends.get(name, "remove it where modes do not depend on it")
            raise file.of(name)[0].error(
                f"{file.counts[name]} {file.what} {name} have no counterpart here; {mend}, or "
                f'leave them out by mesh.ignore = ["{name}"] in a building file (--draft)'
            )
    tables = ModelTables(file, length, force, said)
    file.fill(tables)
    if base is None:
        base = min(point[2] for point in tables.points) if said.base is not None else 0.0
    tables.points = [point - [0.0, 0.0, base] for point in tables.points]
    if said.base is not None:  # a spring there stands between the ground and the building
        carried = {k for _, ends, *_ in tables.lines for k in ends}
        carried |= {k for corners, _ in tables.areas for k in corners}
        sprung = {k for first, second, *_ in tables.springs for k in (first, second)}
        for node, point in enumerate(tables.points):
            if abs(point[2]) < LEVEL and not (node in carried and node in sprung):
                tables.holds.append((node, list(range(3 if said.base == "pinned" else 6))))
    model, names = tables.model(building)
    loose = ~_stiff(model) & ~model.fixed
    held = np.flatnonzero(model.fixed[:, :3].any(axis=1))
    held = np.union1d(held, model.springs.nodes[model.springs.nodes[:, 1] < 0, 0])
    _check(model, held, names, file.file.name)
    model = replace(model, fixed=model.fixed | loose)
    walls, wall_of = _walls(model)
    levels = zip(building.floors, building.floor_levels, strict=True) if building else ()
    notes = _notes(tables, model, dict(levels))
    if loose.any():
        notes.append(f"Changed: at {loose.any(axis=1).sum()} nodes what nothing stiffens is held.")
    stories = {name: level - base for name, level in tables.levels.items()}
    return ReadModel(model, held, walls, wall_of, tuple(notes), stories, base)


def _notes(tables: ModelTables, model: FiniteElementModel, levels: dict[str, float]) -> list[str]:
    """What was taken, changed and left out."""
    counts = tables.file.counts
    gone = {name: count for name, count in tables.skipped.items() if count}
    gone |= dict(tables.file.left_out) | {name: counts[name] for name in tables.file.unknown}
    missing: Counter[str] = Counter()
    for text, count in gone.items():
        missing[max((n for n in counts if text.startswith(n)), key=len, default="")] += count
    taken = [f"{n} {name}" for name, count in counts.items() if (n := count - missing[name]) > 0]
    total = sum(float(block.mass(model.nodes).sum()) for block in model.elements)
    total += float(model.masses.mass[:, 0].sum())
    kinds = Counter(str(kind) for block in model.elements for kind in block.kind.tolist())
    notes = [
        f"Taken: {', '.join(taken)}.",
        f"They are {', '.join(f'{count} {kind}' for kind, count in kinds.items())} elements.",
        f"Mass of the file {tables.own_mass / 1e3:.6g} t, of the model {total / 1e3:.6g} t.",
        *(f"Changed: {count} {what}." for what, count in tables.changes.items() if count),
    ]
    if gone:
        listed = ", ".join(f"{count} {name}" for name, count in sorted(gone.items()))
        notes.append(f"Left out: {listed}.")
    if levels:
        heights = ", ".join(f"{name} {level:.4g}" for name, level in levels.items())
        notes.append(f"Floors: {heights} m above the base.")
    if kinds["beam"] and not kinds["slab"] and not len(model.links.slave):
        notes.append('Nothing holds floors in their plane; mesh.diaphragms = "*" makes them rigid.')
    if len(model.faces):  # walls of MITC4, two wide: modes 1 % higher than in the limit
        notes.append(f"Factors hold for a fine mesh; this may be stiffer in {tables.file.program}.")
    return notes


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


def _check(model: FiniteElementModel, held: Integers, names: Strings, file: str) -> None:
    """Refuse flat, double and hanging shells, and what has no way to the ground."""
    if not len(held):
        raise BuildingError(f"{file}: no node is held; add supports at the base")
    size, spread = np.ptp(model.nodes, axis=0), np.ptp(model.nodes[held], axis=0)
    for axis in (0, 1):  # a building stands on more than one side of it
        if size[axis] > LEVEL > spread[axis] and spread[2] > 0.5 * size[2]:
            raise BuildingError(
                f"{file}: all that holds it lies in one upright plane, as if {'xy'[axis]} were "
                "up; turn the model so that z is"
            )
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
        first, count = pieces[0][0], len(pieces)
        hang = "1 part hangs" if count == 1 else f"{count} parts hang"
        raise BuildingError(
            f"{file}: {hang} free, such as the {len(pieces[0])} nodes around {names[first]} at "
            f"{place(model.nodes[first])}; join their nodes to the others, or remove them"
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
        cosine = np.abs(np.einsum("nd,nd->n", *normal[pairs].swapaxes(0, 1)))
        flat = cosine > 0.985  # shells of one wall
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
    return names, tuple(by_block.get(id(b), np.full(len(b), -1)) for b in model.elements)
