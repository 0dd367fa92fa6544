"""The flat four-node shell: membrane and plate put together in space, with its mass."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.errors import ModelError
from femupdate.fe.element import ElementMatrices, symmetric
from femupdate.fe.membrane import DRILLING_STABILISATION, membrane_stiffness
from femupdate.fe.plate import plate_mass, plate_stiffness
from femupdate.fe.quadrilateral import (
    CENTRE,
    CORNERS,
    GAUSS_POINTS,
    determinants,
    jacobians,
    shape_functions,
)

IN_PLANE = (6 * np.arange(4)[:, None] + [0, 1, 5]).ravel()
OUT_OF_PLANE = (6 * np.arange(4)[:, None] + [2, 3, 4]).ravel()
_FLAT = 1e-9  # area over the square of the longest diagonal below which an element has no area
_PLANE = 1e-14  # height over size up to which rounding alone lifts a corner off the plane
_AT_ONCE = 512  # elements whose matrices fit the processor's cache
_SHARED = 0.1  # kinds of elements over elements up to which each kind is made once
_SAME = 1e-10  # of the longest side
_SEED = 20240
_FOLDED = 1e-4  # corner Jacobian over the mean one: a corner of 180 degrees has 0


@dataclass(frozen=True)
class MeanPlanes:
    """Shells projected on their mean planes.

    Attributes:
        axes: (n, 3, 3) rows are the local x, y and z axes.
        plane: (n, 4, 2) projected corners, m.
        height: (n, 4) distance of the nodes from the plane, m.
    """

    axes: Floats
    plane: Floats
    height: Floats


def shell_matrices(
    coordinates: Floats,
    thickness: Floats,
    youngs_modulus: Floats,
    poisson_ratio: Floats,
    density: Floats,
    nodes: Integers | None = None,
) -> ElementMatrices:
    """Stiffness and consistent mass of four-node shells.

    Args:
        coordinates: (n, 4, 3) corners in order around the element, m.
        thickness: (n,) m.
        youngs_modulus: (n,) Pa.
        poisson_ratio: (n,).
        density: (n,) kg/m3.
        nodes: (n, 4) node numbers, for messages only.

    Returns:
        matrices (n, 24, 24).

    Raises:
        ModelError: an element is flat, concave, folded or has an impossible property.
    """
    properties = (thickness, youngs_modulus, poisson_ratio, density)
    whole = ElementMatrices(*(np.empty((len(coordinates), 24, 24)) for _ in range(2)))
    for some, part in shell_matrices_in_parts(coordinates, *properties, nodes):
        whole.stiffness[some] = part.stiffness  # one matrix stands for all that are alike
        whole.mass[some] = part.mass
    return whole


def shell_matrices_in_parts(
    coordinates: Floats,
    thickness: Floats,
    youngs_modulus: Floats,
    poisson_ratio: Floats,
    density: Floats,
    nodes: Integers | None = None,
) -> Iterator[tuple[Integers, ElementMatrices]]:
    """As `shell_matrices`, some elements at a time: which, and their matrices.

    Elements that are alike, as most are in a regular mesh, share one matrix, (1, 24, 24). Otherwise
    a few hundred come at a time: what fits the processor's cache is made twice as fast.
    """
    properties = (thickness, youngs_modulus, poisson_ratio, density)
    _check_properties(*properties, nodes)
    frame = mean_planes(coordinates)
    _check_shape(frame, nodes)
    first, which = _alike(coordinates, properties)
    shared = len(first) < _SHARED * len(which)
    chosen = first if shared else np.arange(len(which))
    for start in range(0, len(chosen), _AT_ONCE):
        some = chosen[start : start + _AT_ONCE]
        part = MeanPlanes(frame.axes[some], frame.plane[some], frame.height[some])
        elastic = (thickness[some], youngs_modulus[some], poisson_ratio[some])
        stiffness = _in_global_axes(_stiffness(part.plane, *elastic), part)
        mass = _in_global_axes(_mass(part.plane, thickness[some], density[some]), part)
        if not shared:
            yield some, ElementMatrices(stiffness, mass)
            continue
        for k in range(len(some)):
            own = np.flatnonzero(which == start + k)
            yield own, ElementMatrices(stiffness[[k]], mass[[k]])


def _alike(coordinates: Floats, properties: tuple[Floats, ...]) -> tuple[Integers, Integers]:
    """First element of every kind that there is, (u,), and the kind of each element, (n,).

    Elements of one kind have the same sides, to ten digits, and the same properties.
    """
    sides = (coordinates[:, 1:] - coordinates[:, :1]).reshape(-1, 9)
    grain = _SAME * np.abs(sides).max(initial=1e-300)
    exact = np.column_stack(properties).view(np.int64)
    key = np.column_stack([np.rint(sides / grain).astype(np.int64), exact])
    odd = np.random.default_rng(_SEED).integers(2**62, size=key.shape[1]) | 1
    _, first, which = np.unique(key @ odd, return_index=True, return_inverse=True)
    if not np.array_equal(key, key[first][which]):  # two kinds with one hash
        return np.arange(len(key)), np.arange(len(key))
    return first, which


def _stiffness(
    plane: Floats, thickness: Floats, youngs_modulus: Floats, poisson_ratio: Floats
) -> Floats:
    """Stiffness in local axes, (n, 24, 24)."""
    elastic = (thickness, youngs_modulus, poisson_ratio)
    stiffness = np.zeros((len(plane), 24, 24))
    stiffness[:, IN_PLANE[:, None], IN_PLANE] = membrane_stiffness(plane, *elastic)
    stiffness[:, OUT_OF_PLANE[:, None], OUT_OF_PLANE] = plate_stiffness(plane, *elastic)
    return stiffness


def _in_global_axes(matrices: Floats, frame: MeanPlanes) -> Floats:
    """Symmetric matrices (n, 24, 24) of the projected corners for global motion of the nodes.

    The same as with `to_local` on either side, in an eighth of the operations.
    """
    size = np.abs(frame.plane).max(axis=(1, 2), initial=0.0)
    warped = np.flatnonzero(np.abs(frame.height).max(axis=1, initial=0.0) > _PLANE * size)
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
    turn = np.zeros((len(frame.axes), 8, 3, 8, 3))
    for block in range(8):
        turn[:, block, :, block] = frame.axes
    return np.asarray(_rigid_arms(frame.height) @ turn.reshape(-1, 24, 24), dtype=np.float64)


def _rigid_arms(height: Floats) -> Floats:
    """Motion of the projected corners for that of the nodes, both in local axes, (n, 24, 24)."""
    matrix = np.zeros((len(height), 4, 6, 4, 6))
    for node in range(4):
        matrix[:, node, :, node] = np.eye(6)
        matrix[:, node, 0, node, 4] = -height[:, node]
        matrix[:, node, 1, node, 3] = height[:, node]
    return matrix.reshape(-1, 24, 24)


def _mass(plane: Floats, thickness: Floats, density: Floats) -> Floats:
    """Consistent mass in local axes, (n, 24, 24).

    The rotation about the normal carries as small a part of the rotary inertia as its stabilising
    stiffness is of the shear modulus: its own vibrations then stay near the thickness-shear
    frequency sqrt(12 G / rho) / t, where the plate theory ends.
    """
    determinant = determinants(jacobians(plane, GAUSS_POINTS))
    shape = shape_functions(GAUSS_POINTS)
    product = np.einsum("ng,gi,gj->nij", determinant, shape, shape)
    translation = density * thickness
    drilling = DRILLING_STABILISATION * translation * thickness**2 / 12.0
    in_plane = np.zeros((len(plane), 4, 3, 4, 3))
    for direction, inertia in enumerate((translation, translation, drilling)):
        in_plane[:, :, direction, :, direction] = inertia[:, None, None] * product
    mass = np.zeros((len(plane), 24, 24))
    mass[:, IN_PLANE[:, None], IN_PLANE] = in_plane.reshape(-1, 12, 12)
    mass[:, OUT_OF_PLANE[:, None], OUT_OF_PLANE] = plate_mass(plane, thickness, density)
    return mass


def _check_shape(frame: MeanPlanes, nodes: Integers | None) -> None:
    corner = determinants(jacobians(frame.plane, CORNERS))
    mean = determinants(jacobians(frame.plane, CENTRE))[:, 0]
    size = np.abs(frame.plane).max(axis=(1, 2), initial=0.0) + np.abs(frame.height).max(axis=1)
    bad = ~((mean > _FLAT * size**2) & (corner.min(axis=1) > _FOLDED * mean))
    if bad.any():
        raise ModelError(
            f"{_name(int(bad.argmax()), nodes)} has no area, a folded side or a corner of 180 "
            "degrees or more; list its four distinct nodes in order around a convex quadrilateral"
        )


def _check_properties(
    thickness: Floats,
    youngs_modulus: Floats,
    poisson_ratio: Floats,
    density: Floats,
    nodes: Integers | None,
) -> None:
    rules = (
        ("thickness", thickness, thickness > 0.0, "positive"),
        ("Young's modulus", youngs_modulus, youngs_modulus > 0.0, "positive"),
        (
            "Poisson's ratio",
            poisson_ratio,
            (poisson_ratio > -1.0) & (poisson_ratio <= 0.5),
            "between -1 and 0.5",
        ),
        ("density", density, density >= 0.0, "zero or positive"),
    )
    for name, values, fine, demand in rules:
        bad = ~(fine & np.isfinite(values))
        if bad.any():
            first = int(bad.argmax())
            raise ModelError(
                f"{_name(first, nodes)} has {name} {values[first]:g}; it must be {demand}"
            )


def _name(element: int, nodes: Integers | None) -> str:
    if nodes is None:
        return f"shell {element}"
    return f"shell {element} (nodes {', '.join(map(str, nodes[element].tolist()))})"
