"""What every kind of element declares, and what the rest of the program may ask of one.

Assembly, checks, export, drawings and the import of meshes know elements only by `Elements`. A new
kind is one file in the folder `elements`; CONTRIBUTING.md shows how.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, NamedTuple, Self

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
