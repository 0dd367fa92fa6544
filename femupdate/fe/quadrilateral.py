"""The bilinear quadrilateral: shape functions, Gauss points and Cartesian gradients."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
GAUSS_POINTS = CORNERS / np.sqrt(3.0)  # 2 x 2, every weight is one
CENTRE = np.zeros((1, 2))


@dataclass(frozen=True)
class PlaneSamples:
    """Quadrilaterals evaluated at a few points of the parent square.

    Attributes:
        gradients: (n, g, 2, 4) derivatives of the shape functions along x and y, 1/m.
        inverse: (n, g, 2, 2) inverse of the Jacobian matrix, 1/m.
        determinant: (n, g) determinant of the Jacobian matrix, m2.
    """

    gradients: Floats
    inverse: Floats
    determinant: Floats


def shape_functions(points: Floats) -> Floats:
    """Values of the four bilinear shape functions at points of the parent square, (g, 4)."""
    return (
        0.25
        * (1.0 + np.outer(points[:, 0], CORNERS[:, 0]))
        * (1.0 + np.outer(points[:, 1], CORNERS[:, 1]))
    )


def parent_derivatives(points: Floats) -> Floats:
    """Derivatives of the shape functions along xi and eta, (g, 2, 4)."""
    along_xi = 0.25 * CORNERS[:, 0] * (1.0 + np.outer(points[:, 1], CORNERS[:, 1]))
    along_eta = 0.25 * CORNERS[:, 1] * (1.0 + np.outer(points[:, 0], CORNERS[:, 0]))
    return np.stack([along_xi, along_eta], axis=1)


def jacobians(plane: Floats, points: Floats) -> Floats:
    """Jacobian matrices d(x, y)/d(xi, eta), rows along xi and eta, (n, g, 2, 2), m."""
    return np.einsum("gai,nib->ngab", parent_derivatives(points), plane)


def determinants(jacobian: Floats) -> Floats:
    """Determinants of 2 x 2 matrices, (..., 2, 2) -> (...)."""
    return jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]


def sample(plane: Floats, points: Floats) -> PlaneSamples:
    """Evaluate flat quadrilaterals.

    Args:
        plane: (n, 4, 2) corners in the element's plane, counter-clockwise, m.
        points: (g, 2) points of the parent square.
    """
    jacobian = jacobians(plane, points)
    determinant = determinants(jacobian)
    adjugate = np.empty_like(jacobian)
    adjugate[..., 0, 0], adjugate[..., 1, 1] = jacobian[..., 1, 1], jacobian[..., 0, 0]
    adjugate[..., 0, 1], adjugate[..., 1, 0] = -jacobian[..., 0, 1], -jacobian[..., 1, 0]
    inverse = adjugate / determinant[..., None, None]
    return PlaneSamples(inverse @ parent_derivatives(points), inverse, determinant)
