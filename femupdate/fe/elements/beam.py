"""The two-node Timoshenko beam in space, with consistent mass."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from femupdate.arrays import Flags, Floats, Integers
from femupdate.fe.links import rigid_arms
from femupdate.fe.model import (
    POISSON,
    POSITIVE_OR_INFINITE,
    ElementMatrices,
    Elements,
    column,
    repeated,
    rows,
    symmetric,
)
from femupdate.fe.opensees import OpenSeesPart, OpenSeesTable, sections

BEAM_FORCES = ("N", "Vy", "Vz", "T", "My", "Mz")

_AXIAL = np.array([0, 6])
_TORSION = np.array([3, 9])
_ARMS_HEAD = ("rigid arms: first x", "y", "z", "second x", "y", "z", "bits of released forces")


@dataclass(frozen=True, kw_only=True)
class Beams(Elements):
    """Two-node Timoshenko beams.

    The stiffness is exact for loads at the nodes (Przemieniecki 1968); the mass holds rotary and
    torsional inertia and is consistent with the shear-flexible shape (Friedman and Kosmatka 1993).

    The local x axis runs from the first end to the second; `up` lies in the local x-z plane, so
    that z = component of `up` normal to x and y = z cross x. `inertia_y` resists bending in the
    x-z plane (displacement along z), `inertia_z` in the x-y plane.

    The forces are those that the joints put on the first end and on the second, in local axes:
    tension is negative at the first and positive at the second. Inertia inside the element is left
    out of them.
    """

    name: ClassVar[str] = "beam"
    cell_type: ClassVar[str] = "line"
    standard: ClassVar[bool] = True
    force_names: ClassVar[tuple[str, ...]] = tuple(
        f"{force}_{end}" for end in ("start", "end") for force in BEAM_FORCES
    )
    opensees_types: ClassVar[tuple[str, ...]] = ("ElasticTimoshenkoBeam",)

    nodes: Integers = rows(2, dtype=np.int64)
    area: Floats = column()  # (n,) m2
    # (n,) m2, effective for shear along local y and z; infinity gives the Euler-Bernoulli beam
    shear_area_y: Floats = column(POSITIVE_OR_INFINITE)
    shear_area_z: Floats = column(POSITIVE_OR_INFINITE)
    inertia_y: Floats = column()  # (n,) m4
    inertia_z: Floats = column()
    torsion_constant: Floats = column()  # (n,) m4
    poisson_ratio: Floats = column(POISSON)  # (n,)
    up: Floats = rows(3)  # (n, 3) vector that fixes the section's orientation
    # (n, 2) width along local y and depth along local z, m; None for those of rectangles with the
    # same area and inertia
    size: Floats | None = None
    # (n, 2, 3) rigid arms from the nodes to the ends of the beam, m, in global axes; None for none
    offset: Floats | None = None
    # (n, 12) True where an end passes no force on, in local axes, the first end's six and then the
    # second's; None for nowhere
    released: Flags | None = None

    @property
    def section(self) -> Floats:
        """Area of the section, (n,) m2."""
        return self.area

    def corners(self, points: Floats) -> Floats:
        """Ends of the beams, behind their rigid arms, (n, 2, 3) m."""
        nodes = points[self.nodes]
        return nodes if self.offset is None else nodes + self.offset

    def matrices(self, points: Floats) -> ElementMatrices:
        """As `Elements.matrices`, (n, 12, 12)."""
        motion, local = self._local(points)
        return local.moved_by(motion)

    def force_rows(self, points: Floats) -> Floats:
        """Forces on both ends in local axes per unit motion of the nodes, (n, 12, 12)."""
        motion, local = self._local(points)
        return local.stiffness @ motion

    def bending_parts(self, points: Floats) -> tuple[Floats, Floats]:
        """Bending stiffness as a sum of four products c c^T, each of bending and shear in series.

        With both second moments of area times 1 + s, shear areas as they are, the sum is
        (1 + s) / (1 + r s) c c^T. What of a released end is not there has c = 0.

        Returns:
            r (n, 4), and c (n, 12, 4) per unit motion of the nodes in global axes.
        """
        motion, local = self._local(points)
        rest = local.stiffness
        bending = self._with(2.0, "inertia_y", "inertia_z", "shear_area_y", "shear_area_z")
        both = bending._local(points)[1].stiffness - rest
        stiffer = self._with(2.0, "inertia_y", "inertia_z")._local(points)[1].stiffness
        turn = np.where(np.arange(12) % 6 < 3, 1.0, self.measure(points)[:, None])
        energy, shapes = np.linalg.eigh(both / turn[:, :, None] / turn[:, None, :])
        energy, shapes = energy[:, -4:], shapes[:, :, -4:]
        # A part with less of the largest energy is what a release took away.
        there = energy > 1e-10 * energy[:, -1:]
        root = np.sqrt(np.where(there, energy, 1.0))[:, None, :]
        columns = np.where(there[:, None, :], shapes * root, 0.0) * turn[:, :, None]
        inverse = np.where(there[:, None, :], shapes / root, 0.0) / turn[:, :, None]
        twice = inverse.mT @ (stiffer - rest + both) @ inverse
        factor, vectors = np.linalg.eigh(symmetric(twice))
        return np.clip(2.0 / np.maximum(factor, 1.0) - 1.0, 0.0, 1.0), motion.mT @ columns @ vectors

    def bending_ends(self, points: Floats, axis: int) -> tuple[Floats, Floats]:
        """Moments about a local axis, 1 for y or 2 for z, at both ends, (n, 2).

        Returns:
            Per unit motion of the nodes in global axes (n, 2, 12), and per unit rotation of either
            end (n, 2, 2).
        """
        motion, local = self._local(points)
        ends = [3 + axis, 9 + axis]
        rows = local.stiffness[:, ends]
        return rows @ motion, rows[:, :, ends]

    def _with(self, factor: float, *names: str) -> Self:
        return replace(self, **{name: factor * getattr(self, name) for name in names})

    def extents(self) -> Floats:
        """Width along local y and depth along local z, (n, 2) m."""
        if self.size is not None:
            return self.size
        inertia = np.stack([self.inertia_z, self.inertia_y], axis=1)
        return np.sqrt(12.0 * inertia / self.area[:, None])

    def opensees(self, youngs_modulus: Floats) -> OpenSeesPart:
        """ElasticTimoshenkoBeam, or elasticBeamColumn where a beam does not shear.

        What is pinned at both ends is a Truss; other hinges are stiff zeroLength elements.
        """
        released = np.zeros((len(self), 12), np.bool_) if self.released is None else self.released
        pinned = (released == np.isin(np.arange(12), (4, 5, 10, 11))).all(axis=1)
        figures, which = sections(
            youngs_modulus,
            youngs_modulus / (2.0 * (1.0 + self.poisson_ratio)),
            self.area,
            self.torsion_constant,
            self.inertia_y,
            self.inertia_z,
            self.shear_area_y,
            self.shear_area_z,
            self.density * self.area,
        )
        head = ("E", "G", "A", "J", "Iy", "Iz", "shear area y", "shear area z", "kg/m")
        arms = np.zeros((len(self), 2, 3)) if self.offset is None else self.offset
        columns = [self.nodes, which, self.up, arms, released @ (1 << np.arange(12))]
        bent, trusses = ([column[chosen] for column in columns] for chosen in (~pinned, pinned))
        names = (*("node", "node", "section", "up x", "y", "z"), *_ARMS_HEAD)
        return OpenSeesPart(
            {
                "BEAM_SECTIONS": OpenSeesTable(head, [figures]),
                "BEAMS": OpenSeesTable(names, bent),
                "TRUSSES": OpenSeesTable(names, trusses),
            },
            _OPENSEES,
        )

    def _local(self, points: Floats) -> tuple[Floats, ElementMatrices]:
        """Local motion of the ends per unit global motion of the nodes, and the local matrices."""
        self.check(points)
        length = self.measure(points)
        motion = repeated(self._axes(points, length), 4)
        if self.offset is not None:
            arms = np.zeros((len(self), 2, 6, 2, 6))
            for end in range(2):
                arms[:, end, :, end] = rigid_arms(self.offset[:, end])
            motion = motion @ arms.reshape(-1, 12, 12)
        stiffness, mass = _local_matrices(length, self)
        if self.released is not None:
            stiffness, mass = _released(stiffness, mass, self)
        return motion, ElementMatrices(stiffness, mass)

    def _axes(self, points: Floats, length: Floats) -> Floats:
        """Local axes as rows, (n, 3, 3)."""
        ends = self.corners(points)
        size = np.abs(ends).max(axis=(1, 2), initial=0.0)
        self.refuse(~(length > 1e-9 * size), "has no length; its ends must be two distinct points")
        x = (ends[:, 1] - ends[:, 0]) / length[:, None]
        across = self.up - np.einsum("nd,nd->n", self.up, x)[:, None] * x
        width = np.linalg.norm(across, axis=1)
        # Below this sine of the angle between `up` and the axis there is no plane.
        parallel = ~(width > 1e-6 * np.linalg.norm(self.up, axis=1))
        self.refuse(parallel, "has `up` along its axis; give a direction across the beam")
        z = across / width[:, None]
        return np.stack([x, np.cross(z, x), z], axis=1)


def _released(stiffness: Floats, mass: Floats, beams: Beams) -> tuple[Floats, Floats]:
    """Condense the released ends; the few patterns of release are treated one by one."""
    assert beams.released is not None
    stiffness, mass = stiffness.copy(), mass.copy()
    patterns, which = np.unique(beams.released, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        if not pattern.any():
            continue
        chosen = which.ravel() == number
        out, kept = np.flatnonzero(pattern), np.flatnonzero(~pattern)
        released = stiffness[chosen][:, out[:, None], out]
        loose = np.linalg.matrix_rank(released, hermitian=True) < len(out)
        members = np.zeros(len(beams), dtype=bool)
        members[np.flatnonzero(chosen)[loose]] = True
        beams.refuse(members, "is released so far that it moves freely; keep one end fixed")
        shapes = np.zeros((int(chosen.sum()), 12, 12))
        shapes[:, kept, kept] = 1.0
        shapes[:, out[:, None], kept] = -np.linalg.solve(
            released, stiffness[chosen][:, out[:, None], kept]
        )
        for matrix in (stiffness, mass):
            matrix[chosen] = np.swapaxes(shapes, 1, 2) @ matrix[chosen] @ shapes
    return stiffness, mass


def _local_matrices(length: Floats, beams: Beams) -> tuple[Floats, Floats]:
    """Stiffness and mass in local axes, (n, 12, 12) each."""
    stiffness, mass = np.zeros((2, len(beams), 12, 12))
    shear_modulus = 0.5 * beams.youngs_modulus / (1.0 + beams.poisson_ratio)
    axial = beams.youngs_modulus * beams.area / length
    torsion = shear_modulus * beams.torsion_constant / length
    polar = beams.inertia_y + beams.inertia_z
    stiffness[:, _AXIAL[:, None], _AXIAL] = _bar(axial, 1.0, -1.0)
    stiffness[:, _TORSION[:, None], _TORSION] = _bar(torsion, 1.0, -1.0)
    line = beams.density * length / 6.0
    mass[:, _AXIAL[:, None], _AXIAL] = _bar(line * beams.area, 2.0, 1.0)
    mass[:, _TORSION[:, None], _TORSION] = _bar(line * polar, 2.0, 1.0)
    for plane, turn, inertia, shear_area in (
        ((1, 5, 7, 11), 1.0, beams.inertia_z, beams.shear_area_y),  # v and rz = +dv/dx
        ((2, 4, 8, 10), -1.0, beams.inertia_y, beams.shear_area_z),  # w and ry = -dw/dx
    ):
        index, sign = np.array(plane), np.array([1.0, turn, 1.0, turn])
        flexural = beams.youngs_modulus * inertia
        ratio = 12.0 * flexural / (shear_modulus * shear_area * length**2)
        flip = np.outer(sign, sign)
        where = (slice(None), index[:, None], index)
        stiffness[where] = flip * _bending_stiffness(length, flexural, ratio)
        translation = _translational_mass(length, beams.density * beams.area, ratio)
        mass[where] = flip * (translation + _rotary_mass(length, beams.density * inertia, ratio))
    return stiffness, mass


def _bar(scale: Floats, diagonal: float, other: float) -> Floats:
    return scale[:, None, None] * np.array([[diagonal, other], [other, diagonal]])


def _plane_matrix(upper: tuple[tuple[Floats, ...], ...]) -> Floats:
    """Full (n, 4, 4) matrices from the rows of their upper triangle."""
    matrix = np.zeros((len(upper[0][0]), 4, 4))
    for i, row in enumerate(upper):
        for j, value in enumerate(row, start=i):
            matrix[:, i, j] = matrix[:, j, i] = value
    return matrix


def _bending_stiffness(length: Floats, flexural: Floats, ratio: Floats) -> Floats:
    """Deflection and slope at both ends, (n, 4, 4); ratio = 12 E I / (G A_s L^2)."""
    ones = np.ones_like(length)
    matrix = _plane_matrix(
        (
            (12.0 * ones, 6.0 * length, -12.0 * ones, 6.0 * length),
            ((4.0 + ratio) * length**2, -6.0 * length, (2.0 - ratio) * length**2),
            (12.0 * ones, -6.0 * length),
            ((4.0 + ratio) * length**2,),
        )
    )
    return (flexural / ((1.0 + ratio) * length**3))[:, None, None] * matrix


def _translational_mass(length: Floats, line_mass: Floats, ratio: Floats) -> Floats:
    """Mass of the deflection, (n, 4, 4) (Friedman and Kosmatka 1993)."""
    square = ratio**2
    push = 70.0 * square + 147.0 * ratio + 78.0
    tilt = (35.0 * square + 77.0 * ratio + 44.0) * length / 4.0
    cross = 35.0 * square + 63.0 * ratio + 27.0
    cross_tilt = (35.0 * square + 63.0 * ratio + 26.0) * length / 4.0
    slope = (7.0 * square + 14.0 * ratio + 8.0) * length**2 / 4.0
    cross_slope = (7.0 * square + 14.0 * ratio + 6.0) * length**2 / 4.0
    matrix = _plane_matrix(
        (
            (push, tilt, cross, -cross_tilt),
            (slope, cross_tilt, -cross_slope),
            (push, -tilt),
            (slope,),
        )
    )
    return (line_mass * length / (210.0 * (1.0 + ratio) ** 2))[:, None, None] * matrix


def _rotary_mass(length: Floats, line_inertia: Floats, ratio: Floats) -> Floats:
    """Mass of the rotation of the sections, (n, 4, 4) (Friedman and Kosmatka 1993)."""
    push = 36.0 * np.ones_like(length)
    tilt = (3.0 - 15.0 * ratio) * length
    slope = (10.0 * ratio**2 + 5.0 * ratio + 4.0) * length**2
    cross_slope = (5.0 * ratio**2 - 5.0 * ratio - 1.0) * length**2
    matrix = _plane_matrix(
        ((push, tilt, -push, tilt), (slope, -tilt, cross_slope), (push, -tilt), (slope,))
    )
    return (line_inertia / (30.0 * length * (1.0 + ratio) ** 2))[:, None, None] * matrix


_OPENSEES = """
for kind, (start, end, which, *numbers) in [
    *(("beam", row) for row in BEAMS), *(("truss", row) for row in TRUSSES)
]:
    tag, up = new("element"), numbers[:3]
    ends = [arm(start, numbers[3:6]), arm(end, numbers[6:9])]
    E, G, A, J, Iy, Iz, shear_y, shear_z, line_mass = BEAM_SECTIONS[int(which)]
    if kind == "truss":
        material = new("material")
        ops.uniaxialMaterial("Elastic", material, E)
        ops.element("Truss", tag, *ends, A, material, "-rho", line_mass, "-cMass", 1)
        continue
    axis = np.subtract(*map(ops.nodeCoord, ends[::-1]))
    for k in range(2):
        ways = [way for way in range(6) if not int(numbers[9]) >> (6 * k + way) & 1]
        if len(ways) < 6:
            end, ends[k] = ends[k], new("node")
            ops.node(ends[k], *ops.nodeCoord(end))
            for way in ways:
                rate = 1e5 * E * (A if way < 3 else Iy + Iz) / np.linalg.norm(axis)
                ops.uniaxialMaterial("Elastic", material := new("material"), rate)
                of = ("-mat", material, "-dir", way + 1, "-orient", *axis, *np.cross(up, axis))
                ops.element("zeroLength", new("element"), end, ends[k], *of)
    ops.geomTransf("Linear", tag, *up)
    mass = ("-mass", line_mass, "-cMass")
    if np.isinf(shear_y) or np.isinf(shear_z):
        ops.element("elasticBeamColumn", tag, *ends, A, E, G, J, Iy, Iz, tag, *mass)
    else:
        figures = (E, G, A, J, Iy, Iz, shear_y, shear_z)
        ops.element(TYPES["beam"], tag, *ends, *figures, tag, *mass)
"""
