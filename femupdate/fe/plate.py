"""Bending and transverse shear stiffness of the shell: MITC4."""

import numpy as np

from femupdate.fe.membrane import integrate, plane_stress
from femupdate.fe.model import Floats
from femupdate.fe.quadrilateral import GAUSS_POINTS, PlaneSamples, sample

SHEAR_CORRECTION = 5.0 / 6.0

# Columns are grouped as w (4), rotation about x (4), rotation about y (4).
_W, _RX, _RY = slice(0, 4), slice(4, 8), slice(8, 12)
_NODE_BY_NODE = np.arange(12).reshape(3, 4).T.ravel()
# The edges whose middles tie the covariant shear strains, each from its first to its second node.
_EDGES_ALONG_XI = ((0, 1), (3, 2))  # eta = -1, +1
_EDGES_ALONG_ETA = ((0, 3), (1, 2))  # xi = -1, +1


def plate_stiffness(
    plane: Floats, thickness: Floats, youngs_modulus: Floats, poisson_ratio: Floats
) -> Floats:
    """Stiffness of flat quadrilaterals against bending and transverse shear.

    The shear strains are interpolated from the middles of the edges, so that thin plates do not
    lock (Bathe and Dvorkin 1985).

    Args:
        plane: (n, 4, 2) corners in the element's plane, counter-clockwise, m.
        thickness: (n,) m.
        youngs_modulus: (n,) Pa.
        poisson_ratio: (n,).

    Returns:
        (n, 12, 12) for w and the rotations about x and y, node by node.
    """
    gauss = sample(plane, GAUSS_POINTS)
    curvature = _curvature(gauss)
    bending = plane_stress(youngs_modulus, poisson_ratio) * (thickness**3 / 12.0)[:, None, None]
    stiffness = integrate(curvature, bending[:, None] @ curvature, gauss.determinant)
    shear = _shear(plane, gauss)
    rigidity = SHEAR_CORRECTION * thickness * 0.5 * youngs_modulus / (1.0 + poisson_ratio)
    stiffness += integrate(shear, rigidity[:, None, None, None] * shear, gauss.determinant)
    return stiffness[:, _NODE_BY_NODE[:, None], _NODE_BY_NODE]


def _curvature(gauss: PlaneSamples) -> Floats:
    """Curvatures (x, y, twice xy) per unit coordinate, (n, g, 3, 12), of u = z ry, v = -z rx."""
    curvature = np.zeros((*gauss.determinant.shape, 3, 12))
    along_x, along_y = gauss.gradients[:, :, 0], gauss.gradients[:, :, 1]
    curvature[:, :, 0, _RY] = along_x
    curvature[:, :, 1, _RX] = -along_y
    curvature[:, :, 2, _RY] = along_y
    curvature[:, :, 2, _RX] = -along_x
    return curvature


def _shear(plane: Floats, gauss: PlaneSamples) -> Floats:
    """Assumed shear strains (xz, yz) per unit coordinate at the Gauss points, (n, g, 2, 12)."""
    xi, eta = GAUSS_POINTS.T
    below, above = (_edge_shear(plane, edge) for edge in _EDGES_ALONG_XI)
    left, right = (_edge_shear(plane, edge) for edge in _EDGES_ALONG_ETA)
    along_xi = _between(below, above, eta)
    along_eta = _between(left, right, xi)
    return gauss.inverse @ np.stack([along_xi, along_eta], axis=2)


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
