"""The finite-element model as data: nodes, shells, beams, masses, springs and supports."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

DOF_PER_NODE = 6
DOF_NAMES = ("ux", "uy", "uz", "rx", "ry", "rz")
CONSTANT = -1  # group of an element whose stiffness no parameter scales


def _no_rows(*shape: int) -> Floats:
    return np.zeros(shape)


def _no_indices(*shape: int) -> Integers:
    return np.zeros(shape, dtype=np.int64)


@dataclass(frozen=True)
class Shells:
    """Four-node shells, one row an element.

    Attributes:
        nodes: (n, 4) node indices, in order around the element.
        thickness: (n,) m.
        youngs_modulus: (n,) Pa.
        poisson_ratio: (n,).
        density: (n,) kg/m3.
        group: (n,) index of the parameter that multiplies the stiffness, `CONSTANT` for none.
        kind: (n,) what the element is in the building, such as "wall" or "slab".
    """

    nodes: Integers = field(default_factory=lambda: _no_indices(0, 4))
    thickness: Floats = field(default_factory=lambda: _no_rows(0))
    youngs_modulus: Floats = field(default_factory=lambda: _no_rows(0))
    poisson_ratio: Floats = field(default_factory=lambda: _no_rows(0))
    density: Floats = field(default_factory=lambda: _no_rows(0))
    group: Integers = field(default_factory=lambda: _no_indices(0))
    kind: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, dtype="<U24"))

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class Beams:
    """Two-node Timoshenko beams, one row an element.

    The local x axis runs from the first node to the second; `up` lies in the local x-z plane, so
    that z = component of `up` normal to x and y = z cross x. `inertia_y` resists bending in the
    x-z plane (displacement along z), `inertia_z` in the x-y plane.

    Attributes:
        nodes: (n, 2) node indices.
        area: (n,) m2.
        shear_area_y, shear_area_z: (n,) m2, effective for shear along local y and z;
            infinity gives the Euler-Bernoulli beam.
        inertia_y, inertia_z: (n,) m4.
        torsion_constant: (n,) m4.
        youngs_modulus: (n,) Pa.
        poisson_ratio: (n,).
        density: (n,) kg/m3.
        up: (n, 3) vector that fixes the section's orientation.
        group, kind: as for `Shells`.
    """

    nodes: Integers = field(default_factory=lambda: _no_indices(0, 2))
    area: Floats = field(default_factory=lambda: _no_rows(0))
    shear_area_y: Floats = field(default_factory=lambda: _no_rows(0))
    shear_area_z: Floats = field(default_factory=lambda: _no_rows(0))
    inertia_y: Floats = field(default_factory=lambda: _no_rows(0))
    inertia_z: Floats = field(default_factory=lambda: _no_rows(0))
    torsion_constant: Floats = field(default_factory=lambda: _no_rows(0))
    youngs_modulus: Floats = field(default_factory=lambda: _no_rows(0))
    poisson_ratio: Floats = field(default_factory=lambda: _no_rows(0))
    density: Floats = field(default_factory=lambda: _no_rows(0))
    up: Floats = field(default_factory=lambda: _no_rows(0, 3))
    group: Integers = field(default_factory=lambda: _no_indices(0))
    kind: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, dtype="<U24"))

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class PointMasses:
    """Masses at nodes.

    Attributes:
        node: (n,) node indices.
        mass: (n,) kg, the same in x, y and z.
        inertia: (n, 3) kg m2 about x, y and z.
    """

    node: Integers = field(default_factory=lambda: _no_indices(0))
    mass: Floats = field(default_factory=lambda: _no_rows(0))
    inertia: Floats = field(default_factory=lambda: _no_rows(0, 3))

    def __len__(self) -> int:
        return len(self.node)


@dataclass(frozen=True)
class Springs:
    """Springs between a degree of freedom and the ground, or between those of two nodes.

    Attributes:
        nodes: (n, 2) node indices; -1 in the second column means the ground.
        direction: (n,) 0 to 5, an index into `DOF_NAMES`.
        stiffness: (n,) N/m or N m/rad.
        group: as for `Shells`.
    """

    nodes: Integers = field(default_factory=lambda: _no_indices(0, 2))
    direction: Integers = field(default_factory=lambda: _no_indices(0))
    stiffness: Floats = field(default_factory=lambda: _no_rows(0))
    group: Integers = field(default_factory=lambda: _no_indices(0))

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class FiniteElementModel:
    """All that the solver needs to know.

    Attributes:
        nodes: (N, 3) coordinates, m; z is up.
        fixed: (N, 6) True where a degree of freedom is held.
        groups: number of stiffness parameters theta.
    """

    nodes: Floats
    fixed: Flags
    groups: int
    shells: Shells = field(default_factory=Shells)
    beams: Beams = field(default_factory=Beams)
    masses: PointMasses = field(default_factory=PointMasses)
    springs: Springs = field(default_factory=Springs)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom before supports."""
        return self.nodes.shape[0] * DOF_PER_NODE
