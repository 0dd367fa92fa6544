"""The finite-element model as data: nodes, elements, masses, springs, links and supports."""

from dataclasses import dataclass, field

import numpy as np

from femupdate.arrays import Flags, Floats, Integers, Strings

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
    kind: Strings = field(default_factory=lambda: np.zeros(0, dtype="<U24"))

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class Triangles:
    """Three-node shells, one row an element; attributes as for `Shells`, `nodes` (n, 3)."""

    nodes: Integers = field(default_factory=lambda: _no_indices(0, 3))
    thickness: Floats = field(default_factory=lambda: _no_rows(0))
    youngs_modulus: Floats = field(default_factory=lambda: _no_rows(0))
    poisson_ratio: Floats = field(default_factory=lambda: _no_rows(0))
    density: Floats = field(default_factory=lambda: _no_rows(0))
    group: Integers = field(default_factory=lambda: _no_indices(0))
    kind: Strings = field(default_factory=lambda: np.zeros(0, dtype="<U24"))

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class Beams:
    """Two-node Timoshenko beams, one row an element.

    The local x axis runs from the first end to the second; `up` lies in the local x-z plane, so
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
        offset: (n, 2, 3) rigid arms from the nodes to the ends of the beam, m, in global axes;
            None for none.
        released: (n, 12) True where an end passes no force on, in local axes, the first end's six
            and then the second's; None for nowhere.
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
    kind: Strings = field(default_factory=lambda: np.zeros(0, dtype="<U24"))
    offset: Floats | None = None
    released: Flags | None = None

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
class RigidLinks:
    """Nodes that follow another one as if a rigid body joined the two.

    The motion of a slave is u_s = u_m + r_m cross (x_s - x_m), r_s = r_m, and only what is tied of
    it is taken from the master. Slaves are eliminated, not held by stiff springs. A master may be
    another link's slave; a degree of freedom follows one master only.

    Attributes:
        master: (n,) node indices.
        slave: (n,) node indices.
        tied: (n, 6) which degrees of freedom of the slave follow, in the order of `DOF_NAMES`.
    """

    master: Integers = field(default_factory=lambda: _no_indices(0))
    slave: Integers = field(default_factory=lambda: _no_indices(0))
    tied: Flags = field(default_factory=lambda: np.zeros((0, DOF_PER_NODE), dtype=np.bool_))

    def __len__(self) -> int:
        return len(self.master)


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
    triangles: Triangles = field(default_factory=Triangles)
    links: RigidLinks = field(default_factory=RigidLinks)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom before supports."""
        return self.nodes.shape[0] * DOF_PER_NODE
