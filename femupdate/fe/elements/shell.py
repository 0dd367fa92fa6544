"""The flat four-node shell: membrane and plate put together in space, with its mass."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.fe.membrane import (
    CENTRE,
    CORNERS,
    GAUSS_POINTS,
    determinants,
    jacobians,
    membrane_stiffness,
    shape_functions,
)
from femupdate.fe.model import ElementMatrices, repeated, rows, symmetric
from femupdate.fe.plate import plate_mass, plate_stiffness
from femupdate.fe.surface import Surface

_AT_ONCE = 512  # elements whose matrices fit the processor's cache


@dataclass(frozen=True)
class MeanPlanes:
    """Shells projected on their mean planes."""

    # (n, 3, 3) rows are the local x, y and z axes; x runs from the middle of the side 4-1 to the
    # middle of the side 2-3
    axes: Floats
    plane: Floats  # (n, 4, 2) projected corners, m
    height: Floats  # (n, 4) distance of the nodes from the plane, m

    def taken(self, chosen: Integers) -> "MeanPlanes":
        """Those of some of the shells."""
        return MeanPlanes(self.axes[chosen], self.plane[chosen], self.height[chosen])


@dataclass(frozen=True, kw_only=True)
class Shells(Surface):
    """Four-node shells: incompatible modes and drilling rotations in the plane, MITC4 across it."""

    name: ClassVar[str] = "shell"
    cell_type: ClassVar[str] = "quad"
    standard: ClassVar[bool] = True
    opensees_types: ClassVar[tuple[str, ...]] = ("ASDShellQ4", "ShellMITC4", "ShellDKGQ")

    nodes: Integers = rows(4, dtype=np.int64)

    def matrices(self, points: Floats) -> ElementMatrices:
        """As `Elements.matrices`, (n, 24, 24)."""
        whole = ElementMatrices(*(np.empty((len(self), 24, 24)) for _ in range(2)))
        for some, part in self.matrices_in_parts(points):
            whole.stiffness[some] = part.stiffness  # one matrix stands for all that are alike
            whole.mass[some] = part.mass
        return whole

    def matrices_in_parts(self, points: Floats) -> Iterator[tuple[Integers, ElementMatrices]]:
        """As `matrices`, some elements at a time: which, and their matrices.

        Elements that are alike, as most are in a regular mesh, share one matrix, (1, 24, 24).
        Otherwise a few hundred come at a time: what fits the processor's cache is made twice as
        fast.
        """
        self.check(points)
        corners = self.corners(points)
        frame = mean_planes(corners)
        self._check_shape(frame)
        first, which = _alike(corners, (*self.elastic, self.density))
        # Each kind is made once where there are ten elements of it and more.
        shared = len(first) < 0.1 * len(which)
        chosen = first if shared else np.arange(len(which))
        for start in range(0, len(chosen), _AT_ONCE):
            some = chosen[start : start + _AT_ONCE]
            elements, planes = self.taken(some), frame.taken(some)
            stiffness = _in_global_axes(elements._stiffness(planes.plane), planes)
            mass = _in_global_axes(elements._mass(planes.plane), planes)
            if not shared:
                yield some, ElementMatrices(stiffness, mass)
                continue
            for k in range(len(some)):
                alike = np.flatnonzero(which == start + k)
                yield alike, ElementMatrices(stiffness[[k]], mass[[k]])

    def membrane(self, points: Floats) -> Floats:
        """Stiffness in global axes of shells that do not bend, (n, 24, 24)."""
        frame = mean_planes(self.corners(points))
        local, in_plane = np.zeros((len(self), 24, 24)), _IN_PLANE
        local[:, in_plane[:, None], in_plane] = membrane_stiffness(frame.plane, *self.elastic)
        motion = to_local(frame)
        return symmetric(np.swapaxes(motion, 1, 2) @ local @ motion)

    def _stiffness(self, plane: Floats) -> Floats:
        """Stiffness in local axes, (n, 24, 24)."""
        stiffness = np.zeros((len(plane), 24, 24))
        stiffness[:, _IN_PLANE[:, None], _IN_PLANE] = membrane_stiffness(plane, *self.elastic)
        stiffness[:, _OUT_OF_PLANE[:, None], _OUT_OF_PLANE] = plate_stiffness(plane, *self.elastic)
        return stiffness

    def _mass(self, plane: Floats) -> Floats:
        """Consistent mass in local axes, (n, 24, 24)."""
        determinant = determinants(jacobians(plane, GAUSS_POINTS))
        shape = shape_functions(GAUSS_POINTS)
        product = np.einsum("ng,gi,gj->nij", determinant, shape, shape)
        in_plane = np.zeros((len(plane), 4, 3, 4, 3))
        for direction, inertia in enumerate(self.inertia().T[[0, 1, 5]]):
            in_plane[:, :, direction, :, direction] = inertia[:, None, None] * product
        mass = np.zeros((len(plane), 24, 24))
        mass[:, _IN_PLANE[:, None], _IN_PLANE] = in_plane.reshape(-1, 12, 12)
        across = plate_mass(plane, self.thickness, self.density)
        mass[:, _OUT_OF_PLANE[:, None], _OUT_OF_PLANE] = across
        return mass

    def _check_shape(self, frame: MeanPlanes) -> None:
        corner = determinants(jacobians(frame.plane, CORNERS))
        mean = determinants(jacobians(frame.plane, CENTRE))[:, 0]
        size = np.abs(frame.plane).max(axis=(1, 2), initial=0.0) + np.abs(frame.height).max(axis=1)
        # No area, beside the longest diagonal; a corner of 180 degrees has a Jacobian of 0.
        self.refuse(
            ~((mean > 1e-9 * size**2) & (corner.min(axis=1) > 1e-4 * mean)),
            "has no area, a folded side or a corner of 180 degrees or more; list its four distinct "
            "nodes in order around a convex quadrilateral",
        )


_IN_PLANE = Shells.directions(0, 1, 5)
_OUT_OF_PLANE = Shells.directions(2, 3, 4)


def _alike(coordinates: Floats, properties: tuple[Floats, ...]) -> tuple[Integers, Integers]:
    """First element of every kind that there is, (u,), and the kind of each element, (n,)."""
    sides = (coordinates[:, 1:] - coordinates[:, :1]).reshape(-1, 9)
    # Sides are the same to ten digits of the longest.
    grain = 1e-10 * np.abs(sides).max(initial=1e-300)
    exact = np.column_stack(properties).view(np.int64)
    key = np.column_stack([np.rint(sides / grain).astype(np.int64), exact])
    odd = np.random.default_rng(20240).integers(2**62, size=key.shape[1]) | 1
    _, first, which = np.unique(key @ odd, return_index=True, return_inverse=True)
    if not np.array_equal(key, key[first][which]):  # two kinds with one hash
        return np.arange(len(key)), np.arange(len(key))
    return first, which


def _in_global_axes(matrices: Floats, frame: MeanPlanes) -> Floats:
    """Symmetric matrices (n, 24, 24) of the projected corners for global motion of the nodes."""
    size = np.abs(frame.plane).max(axis=(1, 2), initial=0.0)
    # Rounding alone lifts a corner off the plane by so much of the size.
    warped = np.flatnonzero(np.abs(frame.height).max(axis=1, initial=0.0) > 1e-14 * size)
    arms = _rigid_arms(frame.height[warped])
    matrices[warped] = np.swapaxes(arms, 1, 2) @ matrices[warped] @ arms
    for _ in range(2):
        turned = (matrices.reshape(-1, 24 * 8, 3) @ frame.axes).reshape(-1, 24, 24)
        matrices = np.ascontiguousarray(np.swapaxes(turned, 1, 2))
    return symmetric(matrices)


def mean_planes(coordinates: Floats) -> MeanPlanes:
    """Mean planes: through the centroid of the corners, along both bisectors of the sides."""
    centred = coordinates - coordinates.mean(axis=1, keepdims=True)
    along_xi = np.einsum("i,nid->nd", CORNERS[:, 0], centred)
    along_eta = np.einsum("i,nid->nd", CORNERS[:, 1], centred)
    x = _unit(along_xi)
    z = _unit(np.cross(along_xi, along_eta))
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    local = np.einsum("nij,nkj->nki", axes, centred)
    return MeanPlanes(axes, local[..., :2], local[..., 2])


def _unit(vectors: Floats) -> Floats:
    """Unit vectors; a vector of no length stays so and is reported by the checks."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)


def to_local(frame: MeanPlanes) -> Floats:
    """From global motion of the nodes to local motion of the projected corners, (n, 24, 24).

    A rigid arm joins each node to its projection, u' = u + r cross (p' - p), so that forces of the
    flat element stay in equilibrium at the nodes of a warped one.
    """
    return np.asarray(_rigid_arms(frame.height) @ repeated(frame.axes, 8), dtype=np.float64)


def _rigid_arms(height: Floats) -> Floats:
    """Motion of the projected corners for that of the nodes, both in local axes, (n, 24, 24)."""
    matrix = np.zeros((len(height), 4, 6, 4, 6))
    for node in range(4):
        matrix[:, node, :, node] = np.eye(6)
        matrix[:, node, 0, node, 4] = -height[:, node]
        matrix[:, node, 1, node, 3] = height[:, node]
    return matrix.reshape(-1, 24, 24)
