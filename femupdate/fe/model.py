"""The finite-element model as data: nodes, elements, masses, springs, links and supports."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self, TypeVar

import numpy as np

from femupdate.arrays import Flags, Floats, Integers
from femupdate.fe.element import Elements, rows

DOF_PER_NODE = 6
DOF_NAMES = ("ux", "uy", "uz", "rx", "ry", "rz")
CONSTANT = -1  # group of an element whose stiffness no parameter scales

E = TypeVar("E", bound=Elements)


@dataclass(frozen=True)
class PointMasses:
    """Masses at nodes.

    Attributes:
        node: (n,) node indices.
        mass: (n,) kg, the same in x, y and z.
        inertia: (n, 3) kg m2 about x, y and z.
    """

    node: Integers = rows(dtype=np.int64)
    mass: Floats = rows()
    inertia: Floats = rows(3)

    def __len__(self) -> int:
        return len(self.node)


@dataclass(frozen=True)
class Springs:
    """Springs between a degree of freedom and the ground, or between those of two nodes.

    Attributes:
        nodes: (n, 2) node indices; -1 in the second column means the ground.
        direction: (n,) 0 to 5, an index into `DOF_NAMES`.
        stiffness: (n,) N/m or N m/rad.
        group: as for `Elements`.
    """

    name: ClassVar[str] = "spring"

    nodes: Integers = rows(2, dtype=np.int64)
    direction: Integers = rows(dtype=np.int64)
    stiffness: Floats = rows()
    group: Integers = rows(dtype=np.int64)

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class RigidLinks:
    """Nodes that follow another one as if a rigid body joined the two.

    A slave moves as u_s = u_m + r_m cross (x_s - x_m), r_s = r_m, in the directions that are tied;
    in the others it moves by itself. Slaves are eliminated, not held by stiff springs. A master may
    be another link's slave; a degree of freedom follows one master only.

    Attributes:
        master: (n,) node indices.
        slave: (n,) node indices.
        tied: (n, 6) which degrees of freedom of the slave follow, in the order of `DOF_NAMES`.
    """

    master: Integers = rows(dtype=np.int64)
    slave: Integers = rows(dtype=np.int64)
    tied: Flags = rows(DOF_PER_NODE, dtype=np.bool_)

    def __len__(self) -> int:
        return len(self.master)


@dataclass(frozen=True)
class FiniteElementModel:
    """All that the solver needs to know.

    Attributes:
        nodes: (N, 3) coordinates, m; z is up.
        fixed: (N, 6) True where a degree of freedom is held.
        groups: number of stiffness parameters theta.
        elements: one block per kind; blocks without elements are dropped.
    """

    nodes: Floats
    fixed: Flags
    groups: int
    elements: tuple[Elements, ...] = ()
    masses: PointMasses = field(default_factory=PointMasses)
    springs: Springs = field(default_factory=Springs)
    links: RigidLinks = field(default_factory=RigidLinks)

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", tuple(block for block in self.elements if len(block)))

    @property
    def dof(self) -> int:
        """Number of degrees of freedom before supports."""
        return self.nodes.shape[0] * DOF_PER_NODE

    @property
    def element_count(self) -> int:
        """Number of elements of all kinds."""
        return sum(len(block) for block in self.elements)

    @property
    def lines(self) -> Integers:
        """Ends of all elements that are lines, (n, 2) node indices."""
        bars = [block.nodes for block in self.elements if block.dimension() == 1]
        return np.concatenate([np.zeros((0, 2), dtype=np.int64), *bars])

    @property
    def faces(self) -> Integers:
        """Corners of all elements that are surfaces, (n, 4); a triangle repeats its last node."""
        flat = [block.nodes for block in self.elements if block.dimension() == 2]
        quads = [nodes[:, [0, 1, 2, -1]] for nodes in flat]
        return np.concatenate([np.zeros((0, 4), dtype=np.int64), *quads])

    def elements_of(self, kind: type[E]) -> E:
        """The elements of one kind; an empty block where there are none."""
        return next((block for block in self.elements if isinstance(block, kind)), kind())

    def mapped(self, change: Callable[[Elements], Elements]) -> Self:
        """The model with every block of elements changed."""
        return replace(self, elements=tuple(change(block) for block in self.elements))

    def with_elements(self, *blocks: Elements) -> Self:
        """The model with these blocks in place of its own of the same kinds."""
        by_kind = {type(block): block for block in (*self.elements, *blocks)}
        return replace(self, elements=tuple(by_kind.values()))
