"""The finite-element model as data: nodes, elements, masses, springs, links and supports.

Assembly, checks, export, drawings and the import of meshes know elements only by `Elements`. A new
kind is one file in the folder `elements`; CONTRIBUTING.md shows how.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Flags, Floats, Integers, Strings
from femupdate.errors import StructureError
from femupdate.fe.opensees import OpenSeesPart

_LABELS = {"youngs_modulus": "Young's modulus", "poisson_ratio": "Poisson's ratio"}


class Demand(NamedTuple):
    """What the values of a field must be."""

    words: str
    holds: Callable[[Floats], Flags]


POSITIVE = Demand("positive", lambda v: (v > 0.0) & np.isfinite(v))
POSITIVE_OR_INFINITE = Demand("positive", lambda v: v > 0.0)
NOT_NEGATIVE = Demand("zero or positive", lambda v: (v >= 0.0) & np.isfinite(v))
POISSON = Demand("between -1 and 0.5", lambda v: (v > -1.0) & (v <= 0.5))


def column(demand: Demand = POSITIVE) -> Any:
    """A field of numbers (n,), one per element, that `Elements.check` holds to a demand."""
    return field(default_factory=lambda: np.zeros(0), metadata={"demand": demand})


def rows(*shape: int, dtype: Any = np.float64) -> Any:
    """A field with an array (n, *shape)."""
    return field(default_factory=lambda: np.zeros((0, *shape), dtype=dtype))


@dataclass(frozen=True)
class ElementMatrices:
    """Element matrices, six degrees of freedom per node in the order of `DOF_NAMES`."""

    stiffness: Floats  # (n, d, d) N/m, N and N m
    mass: Floats  # (n, d, d) kg, kg m and kg m2

    def moved_by(self, motion: Floats) -> "ElementMatrices":
        """The matrices for other coordinates, whose unit motions are the columns of (n, d, d)."""
        back = np.swapaxes(motion, 1, 2)
        return ElementMatrices(
            symmetric(back @ self.stiffness @ motion), symmetric(back @ self.mass @ motion)
        )


@dataclass(frozen=True, kw_only=True)
class Elements(ABC):
    """Elements of one kind, one row per element."""

    name: ClassVar[str]  # of one such element, in messages and building files
    cell_type: ClassVar[str]  # of the elements in mesh files, by meshio's names, such as "quad"
    # whether cells of this type in mesh files become such elements unless the building file names
    # another kind
    standard: ClassVar[bool] = False
    force_names: ClassVar[tuple[str, ...]] = ()  # of the r forces that `force_rows` gives
    # the element types of OpenSees that can stand for it, the usual one first
    opensees_types: ClassVar[tuple[str, ...]] = ()

    nodes: Integers = rows(0, dtype=np.int64)  # (n, k) node indices, in order around a surface
    youngs_modulus: Floats = column()  # (n,) Pa
    density: Floats = column(NOT_NEGATIVE)  # (n,) kg/m3
    # (n,) index of the parameter that multiplies the stiffness, `CONSTANT` for none
    group: Integers = rows(dtype=np.int64)
    # (n,) what the element is in the building, such as "wall" or "slab"
    kind: Strings = rows(dtype="<U24")

    @property
    @abstractmethod
    def section(self) -> Floats:
        """Thickness of surfaces in m, or area of the section of lines in m2, (n,)."""

    @abstractmethod
    def matrices(self, points: Floats) -> ElementMatrices:
        """Stiffness and consistent mass in global axes, (n, 6k, 6k)."""

    def matrices_in_parts(self, points: Floats) -> Iterator[tuple[Integers, ElementMatrices]]:
        """As `matrices`, some elements at a time: which, and their matrices, or one for all."""
        yield np.arange(len(self)), self.matrices(points)

    def force_rows(self, points: Floats) -> Floats:
        """Forces inside the elements per unit motion of their nodes, (n, r, 6k), at theta = 1.

        The order is that of `force_names`; N, N m, or both of them per metre.

        Raises:
            StructureError: this kind of element does not give its forces.
        """
        raise StructureError(
            f"the forces inside a {self.name} are not available; ask for other parts"
        )

    def opensees(self, youngs_modulus: Floats) -> OpenSeesPart:
        """What the OpenSees script needs for these elements.

        Args:
            youngs_modulus: (n,) with the stiffness parameters in it, Pa.

        Raises:
            StructureError: OpenSees has no counterpart.
        """
        raise StructureError(f"the OpenSees script knows no {self.name}; leave such elements out")

    def corners(self, points: Floats) -> Floats:
        """Where the ends or corners are, (n, k, 3) m."""
        return points[self.nodes]

    def measure(self, points: Floats) -> Floats:
        """Length of lines in m, or area of surfaces in m2, (n,)."""
        corners = self.corners(points)
        if self.dimension() == 1:
            return np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
        return np.linalg.norm(area_vectors(corners), axis=1)

    def mass(self, points: Floats) -> Floats:
        """Mass of each element, (n,) kg."""
        return self.measure(points) * self.section * self.density

    @classmethod
    def node_count(cls) -> int:
        """Nodes of an element, k."""
        return int(cls().nodes.shape[1])

    @classmethod
    def dimension(cls) -> int:
        """1 for lines and 2 for surfaces."""
        return 1 if cls.cell_type == "line" else 2

    def scaled(self, factor: Floats) -> Self:
        """These elements with their stiffness multiplied by factors (n,)."""
        return replace(self, youngs_modulus=self.youngs_modulus * factor)

    def taken(self, chosen: Integers) -> Self:
        """Some of the elements, by index."""
        columns = ((item.name, getattr(self, item.name)) for item in fields(self))
        some: dict[str, Any] = {k: v if v is None else v[chosen] for k, v in columns}
        return replace(self, **some)

    def check(self, points: Floats) -> None:
        """Refuse values that are missing or impossible.

        Raises:
            StructureError: names the first such element and its nodes.
        """
        for item in fields(self):
            values = getattr(self, item.name)
            if values is not None and len(values) != len(self):
                raise StructureError(
                    f"{item.name} of the {self.name} elements has {len(values)} rows; give one for "
                    f"each of the {len(self)} elements"
                )
            demand = item.metadata.get("demand")
            if demand is not None and not (fine := demand.holds(values)).all():
                value = values[int(fine.argmin())]
                label = _LABELS.get(item.name, item.name.replace("_", " "))
                self.refuse(~fine, f"has {label} {value:g}; it must be {demand.words}")

    def refuse(self, bad: ArrayLike, complaint: str) -> None:
        """Raise StructureError with the first bad element (n,), its nodes and a complaint."""
        if np.any(bad):
            first = int(np.argmax(bad))
            nodes = ", ".join(map(str, self.nodes[first].tolist()))
            raise StructureError(f"{self.name} {first} (nodes {nodes}) {complaint}")

    def __len__(self) -> int:
        return len(self.nodes)


def symmetric(matrices: Floats) -> Floats:
    """Remove the rounding asymmetry of matrices, (n, d, d) -> (n, d, d)."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def area_vectors(corners: Floats) -> Floats:
    """Normals of triangles or quadrilaterals (n, k, 3) m, as long as their areas, (n, 3) m2."""
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])


def repeated(axes: Floats, count: int) -> Floats:
    """Local axes as rows (n, 3, 3), repeated along the diagonal, (n, 3 count, 3 count)."""
    blocks = np.zeros((len(axes), count, 3, count, 3))
    for block in range(count):
        blocks[:, block, :, block] = axes
    return blocks.reshape(len(axes), 3 * count, 3 * count)


def group_factors(group: Integers, theta: Floats) -> Floats:
    """The parameter (n,) that multiplies each stiffness, 1 where there is none."""
    return np.where(group >= 0, np.append(theta, 1.0)[group], 1.0)


DOF_PER_NODE = 6
DOF_NAMES = ("ux", "uy", "uz", "rx", "ry", "rz")
CONSTANT = -1  # group of an element whose stiffness no parameter scales

E = TypeVar("E", bound=Elements)


@dataclass(frozen=True)
class PointMasses:
    """Masses at nodes."""

    node: Integers = rows(dtype=np.int64)  # (n,) node indices
    mass: Floats = rows(3)  # (n, 3) kg along x, y and z; (n,) stands for the same in all
    inertia: Floats = rows(3)  # (n, 3) kg m2 about x, y and z

    def __post_init__(self) -> None:
        if self.mass.ndim == 1:
            object.__setattr__(self, "mass", np.repeat(self.mass[:, None], 3, axis=1))

    def __len__(self) -> int:
        return len(self.node)


@dataclass(frozen=True)
class Springs:
    """Springs between a degree of freedom and the ground, or between those of two nodes."""

    name: ClassVar[str] = "spring"

    # (n, 2) node indices; -1 in the second column means the ground
    nodes: Integers = rows(2, dtype=np.int64)
    direction: Integers = rows(dtype=np.int64)  # (n,) 0 to 5, an index into `DOF_NAMES`
    stiffness: Floats = rows()  # (n,) N/m or N m/rad
    group: Integers = rows(dtype=np.int64)  # as for `Elements`
    # (n,) N s/m or N m s/rad of a dashpot beside each; None for no dashpots
    damping: Floats | None = None

    @property
    def dashpots(self) -> Floats:
        """(n,) N s/m or N m s/rad."""
        return np.zeros(len(self)) if self.damping is None else self.damping

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class RigidLinks:
    """Nodes that follow another one as if a rigid body joined the two.

    A slave moves as u_s = u_m + r_m cross (x_s - x_m), r_s = r_m, in the directions that are tied;
    in the others it moves by itself. Slaves are eliminated, not held by stiff springs. A master may
    be another link's slave; a degree of freedom follows one master only.
    """

    master: Integers = rows(dtype=np.int64)  # (n,) node indices
    slave: Integers = rows(dtype=np.int64)  # (n,) node indices
    # (n, 6) which degrees of freedom of the slave follow, in the order of `DOF_NAMES`
    tied: Flags = rows(DOF_PER_NODE, dtype=np.bool_)

    def __len__(self) -> int:
        return len(self.master)

    def taken(self, which: Flags) -> Self:
        """Those for which (n,) flags are true."""
        return type(self)(self.master[which], self.slave[which], self.tied[which])

    def joined(self, *others: "RigidLinks") -> "RigidLinks":
        """These links and others."""
        parts = (self, *others)
        return RigidLinks(
            np.concatenate([part.master for part in parts]),
            np.concatenate([part.slave for part in parts]),
            np.concatenate([part.tied for part in parts]),
        )


@dataclass(frozen=True)
class FiniteElementModel:
    """All that the solver needs to know."""

    nodes: Floats  # (N, 3) coordinates, m; z is up
    fixed: Flags  # (N, 6) True where a degree of freedom is held
    groups: int  # number of stiffness parameters theta
    elements: tuple[Elements, ...] = ()  # one block per kind; blocks without elements are dropped
    masses: PointMasses = field(default_factory=PointMasses)
    springs: Springs = field(default_factory=Springs)
    links: RigidLinks = field(default_factory=RigidLinks)
    names: Strings | None = None  # (N,) what a file calls the nodes; empty for those without

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


_LISTED = 8  # nodes named in a message before "and n more"


def check_model(model: FiniteElementModel) -> None:
    """Refuse a model whose parts do not fit together.

    Raises:
        StructureError: an index is out of range, a value is not finite, a node belongs to no
            element, a kind has two blocks, or no degree of freedom is free.
    """
    bad = ~np.isfinite(model.nodes).all(axis=1)
    if bad.any():
        raise StructureError(f"{_nodes(np.flatnonzero(bad))} must have finite coordinates")
    if model.fixed.shape != (len(model.nodes), len(DOF_NAMES)):
        raise StructureError(
            f"`fixed` has shape {model.fixed.shape}; it needs one row of 6 flags for each of the "
            f"{len(model.nodes)} nodes"
        )
    if model.fixed.all():
        raise StructureError("every degree of freedom is held; free those that should move")
    _check_indices(model)
    names = [block.name for block in model.elements]
    double = [name for name in names if names.count(name) > 1]
    if double:
        raise StructureError(
            f"the model has {len(double)} blocks of {double[0]} elements; join them"
        )
    grouped: tuple[Elements | Springs, ...] = (*model.elements, model.springs)
    for block in grouped:
        complaint = "belongs to parameter {}, but the model has {}, numbered from 0"
        _refuse(block.name, block.group >= model.groups, complaint, block.group, model.groups)
    _check_springs_and_masses(model)
    lonely = np.ones(len(model.nodes), dtype=bool)
    connected = [block.nodes for block in model.elements]
    for nodes in [*connected, model.springs.nodes, model.links.master, model.links.slave]:
        lonely[nodes[nodes >= 0]] = False
    if lonely.any():
        raise StructureError(
            f"{_nodes(np.flatnonzero(lonely))} belong to no element, spring or link; remove them "
            "or connect them"
        )


def _check_indices(model: FiniteElementModel) -> None:
    last = len(model.nodes) - 1
    springs, links = model.springs, model.links
    connected = (
        *((block.name, block.nodes, 0) for block in model.elements),
        ("point mass", model.masses.node[:, None], 0),
        (springs.name, springs.nodes[:, :1], 0),
        (springs.name, springs.nodes[:, 1:], -1),
        ("rigid link", np.stack([links.master, links.slave], axis=1), 0),
    )
    for name, nodes, lowest in connected:
        wrong = (nodes < lowest) | (nodes > last)
        named = nodes[np.arange(len(nodes)), wrong.argmax(axis=1)]
        complaint = "names node {}, but there are only nodes 0 to {}"
        _refuse(name, wrong.any(axis=1), complaint, named, last)


def _check_springs_and_masses(model: FiniteElementModel) -> None:
    springs, masses = model.springs, model.masses
    way = springs.direction
    directions = f"directions are 0 to 5 ({', '.join(DOF_NAMES)})"
    _refuse("spring", (way < 0) | (way >= len(DOF_NAMES)), f"acts along {{}}; {directions}", way)
    _refuse("spring", ~np.isfinite(springs.stiffness), "must have a finite stiffness")
    rate = springs.dashpots
    _refuse("spring", ~np.isfinite(rate) | (rate < 0.0), "must have damping, zero or positive")
    alone = springs.nodes[:, 0] == springs.nodes[:, 1]
    _refuse("spring", alone, "joins a node to itself; give two nodes")
    values = np.column_stack([masses.mass, masses.inertia])
    fine = ((values >= 0.0) & np.isfinite(values)).all(axis=1)
    _refuse("point mass", ~fine, "must have a finite mass and inertia, zero or positive")


def _refuse(name: str, bad: ArrayLike, complaint: str, *values: Integers | int) -> None:
    """Raise StructureError with the first that is bad (n,), and what the complaint says of it."""
    if np.any(bad):
        first = int(np.argmax(bad))
        shown = (value if isinstance(value, int) else value[first] for value in values)
        raise StructureError(f"{name} {first} {complaint.format(*shown)}")


def _nodes(indices: Integers) -> str:
    """Nodes by number, the first few of many."""
    named = ", ".join(map(str, indices[:_LISTED].tolist()))
    rest = len(indices) - _LISTED
    more = f" and {rest} more" if rest > 0 else ""
    return f"node{'s' if len(indices) > 1 else ''} {named}{more}"
