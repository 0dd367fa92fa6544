"""A building's full equations as effects see them: one motion direction, a base that may rock.

The displacement of every node is that of a rigid body on the moving base plus u:
    M u'' + C u' + K(theta) u = -rigid_force y'',
    y = (translation, rotation, motion across) of the base.
A shear building is a stick; its heights are the stories' own, or one metre each where not given.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import TypeVar, cast

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.spatial import cKDTree

from femupdate.arrays import Flags, Floats, Integers, Singles
from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.document import Building
from femupdate.building.kinds import FrameBuilding, MeshBuilding, ShearBuilding, shear_operators
from femupdate.building.mesh import mesh_building
from femupdate.building.mesh_check import stories_of_nodes
from femupdate.building.split_mesh import is_large, split_mesh
from femupdate.effects.infill import Infill, infills
from femupdate.errors import BuildingError, brief
from femupdate.fe.assembly import AffineOperators, assemble
from femupdate.fe.factorization import factorize
from femupdate.fe.model import DOF_PER_NODE

# Columns of the base's motion: along, as it leans the building forward, and across.
TRANSLATION, ROTATION, ACROSS = 0, 1, 2
RANGE = " to "  # in places that name several neighbours
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class NodeMotions:
    """Every component of every node's motion, m of them, held and tied ones too."""

    position: Floats  # (m, 3) of the node, m
    axis: Integers  # (m,) 0 to 5, ux to rz
    mass: Floats  # (m,) mass that moves along each translation; zero for rotations
    rigid: Floats  # (m, 3) motion with the base, per unit of each column of its motion
    motion: csr_matrix  # (m, n) motion per unit of each degree of freedom


@dataclass(frozen=True, eq=False)
class Structure:
    """The full model of a building, n degrees of freedom, f floors.

    >>> import femupdate
    >>> from femupdate.effects.structure import structure_of
    >>> structure = structure_of(femupdate.Building.load("shear_3dof"))
    >>> structure.stiffness([1.0, 0.9, 1.0]).shape, structure.levels.shape
    ((3, 3), (3,))
    """

    __repr__ = brief

    building: Building  # what it is the model of
    stiffness_terms: tuple[csc_matrix, ...]  # one (n, n) matrix a story, N/m
    stiffness_constant: csc_matrix  # (n, n) part that no factor scales
    mass: csc_matrix  # (n, n) kg
    # (n, 3) displacement of the degrees of freedom per metre of base translation along the motion,
    # per radian of base rotation that moves what lies above forward, and per metre across
    rigid_shapes: Floats
    rigid_force: Floats  # (n, 3) mass matrix, with that of the supports, times those shapes
    rigid_mass: Floats  # (3, 3) mass, first and second moment of it about the base, mass across
    floor_rows: Floats  # (f, n) what the floors' sensors see of u, in their mean
    levels: Floats  # (f,) heights of the floors above the base, m
    position: Floats  # (n, 3) where each degree of freedom lies, m
    axis: Integers  # (n,) 0 to 5, ux to rz
    points: NodeMotions  # of its nodes
    direction: int  # of the motion, 0 for x, 1 for y
    # (j, n) stretch of dashpots between building and ground, scaled to one N s/m each
    dashpots: Floats
    mesh: BuildingMesh | None = None  # the mesh of a frame
    operators: AffineOperators | None = None  # the assembled mesh of a frame
    mesh_size: float | None = None  # of a frame, m; the building's own where None
    # matrices that effects asked for, by what they are
    known: dict[Hashable, object] = field(default_factory=dict, init=False, repr=False)

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors, bottom to top."""
        return self.building.floors

    @property
    def feet(self) -> Floats:
        """(s,) heights above the base of the floors on which the stories stand, m."""
        return self.levels - self.building.over_foot(self.levels)

    @cached_property
    def drift_rows(self) -> Floats:
        """(s, n) motion of each floor's sensors less that of the floor below at their own places.

        Sensors of two floors may stand apart in plan, where a building that turns moves unlike.
        """
        rows, along = self.building.over_foot(self.floor_rows), self.points.axis == self.direction
        nodes = () if self.mesh is None else self.mesh.floor_nodes.values()
        for story, (seen, foot) in enumerate(zip(nodes, self.building.below, strict=False)):
            under = np.flatnonzero(along & (self.level_of == foot))
            if foot >= 0 and len(under):
                plan = self.points.position[:, :2]
                _, near = cKDTree(plan[under]).query(plan[DOF_PER_NODE * np.asarray(seen)])
                rows[story] = self.floor_rows[story] - self.points.motion[under[near]].mean(axis=0)
        return rows

    def stiffness(self, theta: Floats) -> csc_matrix:
        """K (n, n) at theta (p,)."""
        if self.operators is not None:
            return self.operators.stiffness(theta)
        total = self.stiffness_constant
        for factor, term in zip(theta, self.stiffness_terms, strict=True):
            total = total + factor * term
        return csc_matrix(total)

    @property
    def dashpot_forces(self) -> Floats:
        """(j, n) along each dashpot, as large as that of the base under a unit acceleration."""
        lengths = np.linalg.norm(self.dashpots, axis=1, keepdims=True)
        return np.asarray(self.rigid_mass[TRANSLATION, TRANSLATION] * self.dashpots / lengths)

    @property
    def meshed(self) -> tuple[BuildingMesh, AffineOperators]:
        """Mesh and assembled mesh of a frame, or of a mesh that was read."""
        if self.mesh is None or self.operators is None:
            raise ValueError("a shear building has no mesh")
        return self.mesh, self.operators

    @property
    def is_stick(self) -> bool:
        """Whether masses are lumped: the structure is then its own reduction."""
        return self.operators is None

    @cached_property
    def story_inertia(self) -> Floats:
        """(s, n) force of inertia above the middle of each story, per unit acceleration, kg."""
        if self.operators is None:
            return np.asarray(self._above[:, : len(self.axis)] * self.points.mass)
        found = np.empty((len(self._above), len(self.axis)))
        for row, above in zip(found, self._above, strict=True):
            row[:] = self.operators.gather(self.operators.mass_full @ above)
        return found

    @cached_property
    def story_rigid(self) -> Floats:
        """(s, 2) mass above the middle of each story, and its moment about the base."""
        if self.operators is None:
            return self.story_inertia @ self.rigid_shapes
        return np.asarray(self._above @ (self.operators.mass_full @ self.points.rigid))

    @cached_property
    def _above(self) -> Singles:
        """(s, m) share of each point's motion that each story carries above its middle.

        A point at mid-height carries as much from above as from below: rounding must not decide.
        """
        middle, height = 0.5 * (self.levels + self.feet), self.building.over_foot(self.levels)
        along = np.flatnonzero(self.points.axis == self.direction)
        apart = self.points.position[along, 2] - middle[:, None]
        share = np.where(np.abs(apart) < 1e-6 * height[:, None], 0.5, apart > 0.0)
        if self._story_of is not None:
            # what stands on a story, and itself
            carried = np.linalg.inv(self.building.over_foot(np.eye(len(height)))).T > 0.5
            inside = self._story_of[along] == np.arange(len(height))[:, None]
            share = np.where(inside, share, carried[:, self._story_of[along]])
        above = np.zeros((len(share), len(self.points.axis)), dtype=np.float32)
        above[:, along] = share
        return above

    def inertia_above(self, values: Floats) -> tuple[Floats, Floats]:
        """The same two of point masses (m,) alone, (s, n) and (s, 2)."""
        weighted = self._above * values
        return np.asarray((self.points.motion.T @ weighted.T).T), weighted @ self.points.rigid

    @cached_property
    def _shapes(self) -> tuple[Floats, Floats, float]:
        """(n,) static displacement, the same after two inverse iterations, and `crossing`.

        All at theta = 1. The factorization is not kept: it is large, and cannot be sent to other
        processes.
        """
        factors = factorize(self.stiffness(np.ones(len(self.stiffness_terms))))
        static = shape = factors.solve(self.rigid_force[:, TRANSLATION])
        for _ in range(2):
            shape = factors.solve(self.mass @ shape)
        across = factors.solve(self.rigid_force[:, ACROSS])
        along, beside = (np.abs(self.floor_rows @ each).max() for each in (static, across))
        return static, shape, float(beside / along)

    @property
    def crossing(self) -> float:
        """How far floors follow a force across at rest, over how far they follow one along.

        Less than a thousandth is zero: a third of the least noise that is ever stated.
        """
        share = self._shapes[2]
        return share if share > 1e-3 else 0.0

    @property
    def driving(self) -> tuple[tuple[float, Floats], ...]:
        """Motions of the base (3,) whose responses shapes must give, each with its weight.

        The motion along; and where floors follow what comes across, one on the diagonal.
        """
        along, diagonal = np.eye(3)[TRANSLATION], np.eye(3)[[TRANSLATION, ACROSS]].sum(axis=0)
        beside = ((min(self.crossing, 1.0), diagonal),) if self.crossing else ()
        return ((1.0, along), *beside)

    @property
    def forces(self) -> Floats:
        """(n, e) of unit accelerations in these motions."""
        return np.column_stack([self.rigid_force @ motion for _, motion in self.driving])

    @property
    def static(self) -> Floats:
        """(n,) displacement under unit base acceleration at theta = 1, s2."""
        return self._shapes[0]

    @property
    def roof(self) -> float:
        """The same of the sensors of the roof, s2."""
        return float(self.floor_rows[-1] @ self.static)

    @cached_property
    def fundamental(self) -> tuple[float, Floats]:
        """Circular frequency (rad/s) and mean drifts (s,) of the stories in the first driven mode.

        Rayleigh's quotient after two inverse iterations from the static shape, which is within a
        thousandth of the mode that the base motion drives most; unit modal mass.
        """
        shape = self._shapes[1]
        modal_mass = float(shape @ (self.mass @ shape))
        stiffness = self.stiffness(np.ones(len(self.stiffness_terms)))
        omega = np.sqrt(float(shape @ (stiffness @ shape)) / modal_mass)
        return float(omega), self.building.over_foot(self.floor_means @ shape) / np.sqrt(modal_mass)

    @cached_property
    def _story_of(self) -> Integers | None:
        """(m,) story to which each point belongs; None where heights tell it."""
        if self.mesh is None or self.building.is_chain:
            return None
        return np.repeat(stories_of_nodes(self.mesh.model, self.levels), DOF_PER_NODE)

    @cached_property
    def level_of(self) -> Integers:
        """(m,) index of the floor at whose height a point lies, -1 between floors."""
        tall = np.abs(self.points.position[:, 2, None] - self.levels)
        near = tall.argmin(axis=1) if self._story_of is None else self._story_of
        here = tall[np.arange(len(near)), near] < 1e-6 * self.levels[-1]
        return np.where(here, near, -1)

    def along_floor(self, floor: int) -> Flags:
        """(m,) which points are translations of a floor along the motion."""
        here = (self.level_of == floor) & (self.points.axis == self.direction)
        if not here.any():
            name, level = self.floors[floor], self.levels[floor]
            raise BuildingError(
                f"{self.building.name}: stories: no node lies at the level of {name}, {level:g} m, "
                "so nothing that is missing can be looked for there; give that floor a level with "
                "nodes"
            )
        return here

    @cached_property
    def floor_means(self) -> Floats:
        """(f, n) displacement of each floor along the motion, in the mean over its mass.

        A force that acts through it is spread over the floor; one at the sensors alone would be
        met by what gives there locally.
        """
        here = np.stack([self.along_floor(floor) for floor in range(len(self.levels))])
        weight = np.where(here, self.points.mass, 0.0)
        return (self.points.motion.T @ (weight / weight.sum(axis=1, keepdims=True)).T).T

    def member_stiffness(self, kinds: tuple[str, ...]) -> tuple[csc_matrix, ...]:
        """Stiffness of the members of some kinds, such as "wall", one (n, n) matrix a story."""

        def make() -> tuple[csc_matrix, ...]:
            return self.meshed[1].terms_of(lambda block: np.isin(block.kind, kinds))

        return self.once(("members", kinds), make)

    def once(self, what: Hashable, make: Callable[[], T]) -> T:
        """Matrices that several places of an effect share, made when first asked for."""
        if what not in self.known:
            self.known[what] = make()
        return cast(T, self.known[what])

    @cached_property
    def infills(self) -> tuple[Infill, ...]:
        """The walls that the model only weighs, with the stiffness that it leaves out."""
        if not isinstance(self.building, FrameBuilding):
            return ()
        return infills(self.building, *self.meshed, self.mesh_size)


def structure_of(
    building: Building, mesh_size: float | None = None, *, halved: bool = False
) -> Structure:
    """Assemble a building's full model.

    Args:
        mesh_size: m; the building's own where None.
        halved: every element is split, but those of a mesh that was read and is large.

    Raises:
        BuildingError, StructureError: the building cannot be meshed or stand.
    """
    if isinstance(building, ShearBuilding):
        terms, mass = shear_operators(building)
        count = len(mass)
        heights = np.cumsum([story.height or 1.0 for story in building.stories])
        shapes = np.column_stack([np.ones(count), heights, np.zeros(count)])
        masses = np.diag(mass)
        position = np.column_stack([np.zeros((count, 2)), heights])
        axis = np.zeros(count, dtype=np.int64)
        return Structure(
            building=building,
            stiffness_terms=tuple(csc_matrix(term) for term in terms),
            stiffness_constant=csc_matrix((count, count)),
            mass=csc_matrix(mass),
            rigid_shapes=shapes,
            rigid_force=masses[:, None] * shapes,
            rigid_mass=shapes.T @ (masses[:, None] * shapes),
            floor_rows=np.eye(count),
            levels=heights,
            position=position,
            axis=axis,
            points=NodeMotions(position, axis, masses, shapes, csr_matrix(np.eye(count))),
            direction=0,
            dashpots=np.zeros((0, count)),
        )
    mesh = mesh_building(building, mesh_size)
    stays = isinstance(building, MeshBuilding) and is_large(mesh)
    return _frame(building, split_mesh(mesh) if halved and not stays else mesh, mesh_size)


def _frame(
    building: FrameBuilding | MeshBuilding, mesh: BuildingMesh, mesh_size: float | None
) -> Structure:
    operators = assemble(mesh.model)
    rows = np.zeros((len(mesh.floors), operators.dof))
    for row, nodes in zip(rows, mesh.floor_nodes.values(), strict=True):
        row[DOF_PER_NODE * np.asarray(nodes) + mesh.direction] = 1.0 / len(nodes)
    points, direction = mesh.model.nodes, mesh.direction
    middle = 0.5 * (points[:, direction].min() + points[:, direction].max())
    rigid = np.zeros((len(points), DOF_PER_NODE, 3))
    rigid[:, direction, TRANSLATION] = 1.0
    rigid[:, 1 - direction, ACROSS] = 1.0
    rigid[:, direction, ROTATION] = points[:, 2] - points[:, 2].min()
    rigid[:, 2, ROTATION] = middle - points[:, direction]
    # Forward means about +y for motion along x, and about -x for motion along y.
    rigid[:, 4 if direction == 0 else 3, ROTATION] = 1.0 if direction == 0 else -1.0
    shapes = rigid.reshape(-1, 3)
    force = operators.mass_full @ shapes
    springs = mesh.model.springs
    damped = np.flatnonzero(springs.dashpots)
    dashpots, number = np.zeros((len(damped), operators.dof)), np.arange(len(damped))
    for end, sign in ((0, 1.0), (1, -1.0)):
        node = springs.nodes[damped, end]
        there = node >= 0
        dof = DOF_PER_NODE * node[there] + springs.direction[damped][there]
        dashpots[number[there], dof] = sign * np.sqrt(springs.dashpots[damped][there])
    mass = np.zeros(operators.dof)
    for axis in range(3):
        unit = operators.rigid_translation(axis)
        mass += unit * (operators.mass_full @ unit)
    position, free = np.repeat(points, DOF_PER_NODE, axis=0), operators.free
    axes, motion = np.arange(operators.dof) % DOF_PER_NODE, operators.expansion
    if motion is None:
        entries = np.ones(len(free)), (free, np.arange(len(free)))
        motion = csr_matrix(entries, shape=(operators.dof, len(free)))
    return Structure(
        building=building,
        stiffness_terms=operators.stiffness_terms,
        stiffness_constant=operators.stiffness_constant,
        mass=operators.mass,
        rigid_shapes=shapes[operators.free],
        rigid_force=operators.gather(force),
        rigid_mass=shapes.T @ force,
        floor_rows=operators.gather(rows.T).T,
        levels=mesh.floor_level,
        position=position[free],
        axis=free % DOF_PER_NODE,
        points=NodeMotions(position, axes, mass, shapes, motion),
        direction=mesh.direction,
        dashpots=operators.gather(dashpots.T).T,
        mesh=mesh,
        operators=operators,
        mesh_size=mesh_size,
    )


def ranges_of(names: Sequence[str], below: Sequence[int]) -> tuple[str, ...]:
    """Neighbours of two or more, each on the one before, but for all of them, as in "S2 to S4".

    Args:
        below: on which floor every story stands, as of a `Building`.
    """
    ends = combinations(range(len(names)), 2)
    return tuple(
        f"{names[k]}{RANGE}{names[n]}"
        for k, n in ends
        if n - k < len(names) - 1 and all(below[j] == j - 1 for j in range(k + 1, n + 1))
    )


def numbers_of(place: str, names: Sequence[str]) -> list[int]:
    """Numbers of the floors or stories that a place such as "S2" or "S2 to S4" names, or of all."""
    first, _, last = place.partition(RANGE)
    if first not in names:
        return list(range(len(names)))
    return list(range(names.index(first), names.index(last or first) + 1))
