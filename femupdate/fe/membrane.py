"""In-plane stiffness of the shell: incompatible modes QM6 with drilling rotations."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
GAUSS_POINTS = CORNERS / np.sqrt(3.0)  # 2 x 2, every weight is one
CENTRE = np.zeros((1, 2))


@dataclass(frozen=True)
class PlaneSamples:
    """Quadrilaterals evaluated at a few points of the parent square."""

    gradients: Floats  # (n, g, 2, 4) derivatives of the shape functions along x and y, 1/m
    inverse: Floats  # (n, g, 2, 2) inverse of the Jacobian matrix, 1/m
    determinant: Floats  # (n, g) determinant of the Jacobian matrix, m2


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


# Shares of the shear modulus in the drilling penalty, at the centre and at 2 x 2 points. All of it
# at the centre holds beams at the edge of a wall too firmly: the benchmark's tower of 8,640 shells
# errs by .37 % in its first mode, by .24 % with a twentieth. The centre alone leaves hourglass
# patterns of the drilling rotations free; more at 2 x 2 points locks curved shells.
_DRILLING, DRILLING_STABILISATION = 0.05, 0.01

# Columns are grouped as u (4), v (4), rotation (4), internal modes of u (2) and v (2).
_U, _V, _SPIN = slice(0, 4), slice(4, 8), slice(8, 12)
_NODAL, _INTERNAL = slice(0, 12), slice(12, 16)
_INTERNAL_U, _INTERNAL_V = slice(12, 14), slice(14, 16)
_NODE_BY_NODE = np.arange(12).reshape(3, 4).T.ravel()


def membrane_stiffness(
    plane: Floats, thickness: Floats, youngs_modulus: Floats, poisson_ratio: Floats
) -> Floats:
    """Stiffness of flat quadrilaterals against in-plane motion and rotation about the normal.

    Four incompatible modes an element are condensed (Taylor, Beresford and Wilson 1976). The
    rotation is tied to the spin of the membrane, incompatible modes included, by a penalty with
    a twentieth of the shear modulus (Hughes and Brezzi 1989, who leave its size free), integrated
    at the centre, with one hundredth of the modulus at 2 x 2 points.

    Args:
        plane: (n, 4, 2) corners in the element's plane, counter-clockwise, m.

    Returns:
        (n, 12, 12) for u, v and the rotation about the normal, node by node.
    """
    gauss, centre = sample(plane, GAUSS_POINTS), sample(plane, CENTRE)
    # Gradients of 1 - xi^2 and 1 - eta^2, (n, g, 2, 2). The Jacobian of the centre, scaled by the
    # ratio of determinants, makes their mean vanish on any quadrilateral, which is what the patch
    # test asks (Taylor, Beresford and Wilson 1976).
    parent = np.einsum("ga,ab->gab", -2.0 * GAUSS_POINTS, np.eye(2))
    ratio = centre.determinant / gauss.determinant
    internal = ratio[:, :, None, None] * (centre.inverse @ parent)
    volume = gauss.determinant * thickness[:, None]
    shear_modulus = 0.5 * youngs_modulus / (1.0 + poisson_ratio)

    strain = np.zeros((*gauss.determinant.shape, 3, 16))
    for u, v, slopes in ((_U, _V, gauss.gradients), (_INTERNAL_U, _INTERNAL_V, internal)):
        strain[:, :, 0, u] = strain[:, :, 2, v] = slopes[:, :, 0]
        strain[:, :, 1, v] = strain[:, :, 2, u] = slopes[:, :, 1]
    elasticity = plane_stress(youngs_modulus, poisson_ratio)
    stiffness = integrate(strain, elasticity[:, None] @ strain, volume)

    slip = _slip(gauss, GAUSS_POINTS, internal)
    penalty = DRILLING_STABILISATION * shear_modulus[:, None] * volume
    stiffness += integrate(slip, slip, penalty)
    # At the centre the gradients of the internal modes vanish.
    slip = _slip(centre, CENTRE, np.zeros((len(plane), 1, 2, 2)))
    penalty = 4.0 * _DRILLING * (shear_modulus * thickness)[:, None] * centre.determinant
    stiffness += integrate(slip, slip, penalty)
    coupling = stiffness[:, _INTERNAL, _NODAL]
    relaxed = np.linalg.solve(stiffness[:, _INTERNAL, _INTERNAL], coupling)
    condensed = stiffness[:, _NODAL, _NODAL] - np.swapaxes(coupling, 1, 2) @ relaxed
    return condensed[:, _NODE_BY_NODE[:, None], _NODE_BY_NODE]


def plane_stress(youngs_modulus: Floats, poisson_ratio: Floats) -> Floats:
    """Elasticity matrices for (eps_x, eps_y, gamma_xy) in plane stress, (n, 3, 3), Pa."""
    matrix = np.zeros((len(youngs_modulus), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = youngs_modulus / (1.0 - poisson_ratio**2)
    matrix[:, 0, 1] = matrix[:, 1, 0] = poisson_ratio * matrix[:, 0, 0]
    matrix[:, 2, 2] = 0.5 * youngs_modulus / (1.0 + poisson_ratio)
    return matrix


def integrate(left: Floats, right: Floats, weight: Floats) -> Floats:
    """Sum of weight left^T right over the points, (n, g, r, c) twice -> (n, c, c)."""
    count, points, rows, columns = left.shape
    flat = (left * weight[:, :, None, None]).reshape(count, points * rows, columns)
    return np.swapaxes(flat, 1, 2) @ right.reshape(count, points * rows, columns)


def _slip(samples: PlaneSamples, points: Floats, internal: Floats) -> Floats:
    """Nodal rotation less the membrane's spin per unit coordinate, (n, g, 1, 16)."""
    slip = np.zeros((*samples.determinant.shape, 1, 16))
    slip[:, :, 0, _SPIN] = shape_functions(points)
    for u, v, slopes in ((_U, _V, samples.gradients), (_INTERNAL_U, _INTERNAL_V, internal)):
        slip[:, :, 0, u] = 0.5 * slopes[:, :, 1]
        slip[:, :, 0, v] = -0.5 * slopes[:, :, 0]
    return slip
