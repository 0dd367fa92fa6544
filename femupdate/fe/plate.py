"""Bending and transverse shear stiffness of the shell: MITC4 with internal rotations."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.fe.membrane import (
    CENTRE,
    GAUSS_POINTS,
    determinants,
    integrate,
    jacobians,
    plane_stress,
    sample,
    shape_functions,
)

SHEAR_CORRECTION = 5.0 / 6.0

# Columns are grouped as w (4), rotation about x (4), rotation about y (4).
_W, _RX, _RY = slice(0, 4), slice(4, 8), slice(8, 12)
_NODAL, _INTERNAL = slice(0, 12), slice(12, 16)
# 3 x 3 Gauss points integrate the square of a quadratic deflection.
_LINE = np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
_GAUSS_3 = np.stack([np.repeat(_LINE, 3), np.tile(_LINE, 3)], axis=1)
_NODE_BY_NODE = np.arange(12).reshape(3, 4).T.ravel()
# The edges whose middles tie the covariant shear strains, each from its first to its second node.
_EDGES_ALONG_XI = ((0, 1), (3, 2))  # eta = -1, +1
_EDGES_ALONG_ETA = ((0, 3), (1, 2))  # xi = -1, +1

# Internal rotations 1 - xi^2 along xi, 1 - eta^2 along eta, and these times a sign across, of which
# the shear feels a part: _SKEW x (long side / short side)^_SLENDER. All of it is too soft under a
# force at a node, none too stiff where sides differ and in clamped plates. Both were chosen by the
# rows of the benchmark `solver`, and tried on rectangles of 1 : 2, 1 : 3 and 1 : 8.
_SKEW, _SLENDER = 0.15, 2.0 / 3.0
_XI, _ETA = GAUSS_POINTS.T
_ONE, _NONE = np.ones(4), np.zeros(4)
_INTERNAL_SLOPES = np.array(  # along xi and eta, (2, mode, g)
    [
        [-2.0 * _XI, _NONE, -2.0 * _XI * _ETA, 1.0 - _ETA**2],
        [_NONE, -2.0 * _ETA, 1.0 - _XI**2, -2.0 * _XI * _ETA],
    ]
).transpose(2, 0, 1)
_INTERNAL_SHEAR = (2.0 / 3.0) * np.array(  # their means along the sides, (2, mode, g)
    [[_ONE, _NONE, _ETA, _NONE], [_NONE, _ONE, _NONE, _XI]]
).transpose(2, 0, 1)
# Of the linked deflection in the mass, chosen by trial: modes 1, 2 and 4 of a thin square plate
# on 16 x 16 elements err by -.23, -.14 and -.63 %, with all of it by -.39, -.54 and -1.26 %.
_LINKED = 0.75


def plate_stiffness(
    plane: Floats, thickness: Floats, youngs_modulus: Floats, poisson_ratio: Floats
) -> Floats:
    """Stiffness of flat quadrilaterals against bending and transverse shear.

    The shear strains are interpolated from the middles of the edges, so that thin plates do not
    lock (Bathe and Dvorkin 1985). Rotations that are quadratic inside an element, condensed,
    let its curvature follow the shear force: a strip in cylindrical bending is exact at its nodes,
    as a beam is. MacNeal (1978) has that by a softer shear, the residual bending flexibility.
    Less their mean, curvatures of these rotations leave states of constant curvature as they are.

    Args:
        plane: (n, 4, 2) corners in the element's plane, counter-clockwise, m.

    Returns:
        (n, 12, 12) for w and the rotations about x and y, node by node.
    """
    gauss, centre = sample(plane, GAUSS_POINTS), jacobians(plane, CENTRE)
    area, sides = determinants(centre) * 4.0, np.linalg.norm(centre[:, 0], axis=2)
    # Curvatures (x, y, twice xy) per unit coordinate, of u = z ry, v = -z rx.
    curvature = np.zeros((*gauss.determinant.shape, 3, 16))
    along_x, along_y = gauss.gradients[:, :, 0], gauss.gradients[:, :, 1]
    curvature[:, :, 0, _RY], curvature[:, :, 2, _RY] = along_x, along_y
    curvature[:, :, 1, _RX], curvature[:, :, 2, _RX] = -along_y, -along_x
    slopes = gauss.inverse @ _INTERNAL_SLOPES
    # What a rotation along xi or eta is along x and y, (n, 1, 2, mode).
    turned = sample(plane, CENTRE).inverse[..., [0, 1, 0, 1]]
    internal = curvature[..., _INTERNAL]
    internal[:, :, :2] = slopes * turned
    internal[:, :, 2] = slopes[:, :, 1] * turned[:, :, 0] + slopes[:, :, 0] * turned[:, :, 1]
    mean = np.einsum("ng,ngij->nij", gauss.determinant / area, internal)[:, None]
    internal -= mean
    bending = plane_stress(youngs_modulus, poisson_ratio) * (thickness**3 / 12.0)[:, None, None]
    stiffness = integrate(curvature, bending[:, None] @ curvature, gauss.determinant)
    stiffness[:, _INTERNAL, _INTERNAL] += integrate(mean, bending[:, None] @ mean, area)
    below, above = (_edge_shear(plane, edge) for edge in _EDGES_ALONG_XI)
    left, right = (_edge_shear(plane, edge) for edge in _EDGES_ALONG_ETA)
    tied = np.stack([_between(below, above, _ETA), _between(left, right, _XI)], axis=2)
    inner = np.tile(_INTERNAL_SHEAR, (len(plane), 1, 1, 1))
    skew = _SKEW * (sides.max(axis=1) / sides.min(axis=1)) ** _SLENDER
    inner[..., 2:] *= np.minimum(skew, 1.0)[:, None, None, None]
    shear = gauss.inverse @ np.concatenate([tied, inner], axis=3)
    rigidity = SHEAR_CORRECTION * thickness * 0.5 * youngs_modulus / (1.0 + poisson_ratio)
    stiffness += integrate(shear, rigidity[:, None, None, None] * shear, gauss.determinant)
    coupling = stiffness[:, _INTERNAL, _NODAL]
    relaxed = np.linalg.solve(stiffness[:, _INTERNAL, _INTERNAL], coupling)
    condensed = stiffness[:, _NODAL, _NODAL] - np.swapaxes(coupling, 1, 2) @ relaxed
    return condensed[:, _NODE_BY_NODE[:, None], _NODE_BY_NODE]


def plate_mass(plane: Floats, thickness: Floats, density: Floats) -> Floats:
    """Consistent mass of flat quadrilaterals in motion across their plane.

    The deflection is quadratic along the sides, as the tied shear strains imply: the rotations of
    its ends bend a side by an eighth of its length times their difference (the linked
    interpolation of Auricchio and Taylor 1994). With a bilinear deflection, the frequencies on a
    mesh of size h would err by k^2 h^2 / 8 at the wave number k. Rotations carry
    density thickness^3 / 12.

    Args:
        plane: (n, 4, 2) corners in the element's plane, counter-clockwise, m.

    Returns:
        (n, 12, 12) for w and the rotations about x and y, node by node, kg, kg m and kg m2.
    """
    weights = np.outer([5.0, 8.0, 5.0], [5.0, 8.0, 5.0]).ravel() / 81.0
    determinant = determinants(jacobians(plane, _GAUSS_3)) * weights
    deflection = _linked_deflection(plane, _GAUSS_3)[:, :, None]
    mass = integrate(deflection, deflection, determinant * (density * thickness)[:, None])
    shape = shape_functions(_GAUSS_3)
    rotary = np.einsum("ng,gi,gj->nij", determinant, shape, shape)
    rotary *= (density * thickness**3 / 12.0)[:, None, None]
    mass[:, _RX, _RX] += rotary
    mass[:, _RY, _RY] += rotary
    return mass[:, _NODE_BY_NODE[:, None], _NODE_BY_NODE]


def _linked_deflection(plane: Floats, points: Floats) -> Floats:
    """Deflection per unit coordinate at points of the parent square, (n, g, 12)."""
    xi, eta = points.T
    deflection = np.zeros((len(plane), len(points), 12))
    deflection[:, :, _W] = shape_functions(points)
    for (first, second), bubble in (
        (_EDGES_ALONG_XI[0], (1.0 - xi**2) * (1.0 - eta)),
        (_EDGES_ALONG_XI[1], (1.0 - xi**2) * (1.0 + eta)),
        (_EDGES_ALONG_ETA[0], (1.0 - eta**2) * (1.0 - xi)),
        (_EDGES_ALONG_ETA[1], (1.0 - eta**2) * (1.0 + xi)),
    ):
        side = plane[:, second] - plane[:, first]
        # Slope along the side: dx w,x + dy w,y with w,x = -ry and w,y = rx.
        for node, sign in ((first, 0.0625 * _LINKED), (second, -0.0625 * _LINKED)):
            deflection[:, :, _RY.start + node] -= sign * side[:, :1] * bubble
            deflection[:, :, _RX.start + node] += sign * side[:, 1:] * bubble
    return deflection


def _between(first: Floats, second: Floats, position: Floats) -> Floats:
    """Interpolate between opposite edges, (n, 12) twice and (g,) in -1 to 1 -> (n, g, 12)."""
    weight = 0.5 * (1.0 + position)[:, None]
    return (1.0 - weight) * first[:, None] + weight * second[:, None]


def _edge_shear(plane: Floats, edge: tuple[int, int]) -> Floats:
    """Covariant shear strain in the middle of an edge, per unit coordinate, (n, 12)."""
    first, second = edge
    half = 0.5 * (plane[:, second] - plane[:, first])
    strain = np.zeros((len(plane), 12))
    strain[:, _W.start + first], strain[:, _W.start + second] = -0.5, 0.5
    for node in edge:
        strain[:, _RY.start + node] = 0.5 * half[:, 0]
        strain[:, _RX.start + node] = -0.5 * half[:, 1]
    return strain
