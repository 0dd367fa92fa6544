"""Forces and stresses inside the shells, from displacements."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.errors import ModelError
from femupdate.fe.membrane import membrane_strain, plane_stress
from femupdate.fe.model import FiniteElementModel
from femupdate.fe.plate import plate_curvature
from femupdate.fe.quadrilateral import CORNERS, shape_functions
from femupdate.fe.shell import IN_PLANE, OUT_OF_PLANE, mean_planes, to_local

# The parent square whose corners are the Gauss points sees the element's corners at sqrt(3).
_TO_CORNERS = shape_functions(np.sqrt(3.0) * CORNERS)


@dataclass(frozen=True)
class ShellForces:
    """Stress resultants at the corners of shells, in the axes of each.

    Attributes:
        membrane: (n, 4, 3) forces per length n_x, n_y, n_xy, N/m, tension positive.
        moment: (n, 4, 3) moments per length m_x, m_y, m_xy, N; positive where the upper face (the
            one towards local z) is in tension.
        axes: (n, 3, 3) rows are the local x, y and z axes; x runs from the middle of the side 4-1
            to the middle of the side 2-3.
        thickness: (n,) m.
    """

    membrane: Floats
    moment: Floats
    axes: Floats
    thickness: Floats

    def stress(self, face: float = 0.0) -> Floats:
        """Stresses (n, 4, 3) sigma_x, sigma_y, tau_xy, Pa.

        Args:
            face: +1 for the upper face, -1 for the lower, 0 for the middle.
        """
        thickness = self.thickness[:, None, None]
        return self.membrane / thickness + 6.0 * face * self.moment / thickness**2


def shell_forces(
    model: FiniteElementModel,
    displacement: Floats,
    theta: Floats,
    chosen: Integers | None = None,
) -> ShellForces:
    """Membrane forces and moments of shells, extrapolated from the Gauss points to the corners.

    Args:
        model: whose shells they are.
        displacement: (6N,) or (N, 6), m and rad.
        theta: (p,) stiffness parameters.
        chosen: (n,) which shells; default all.

    Raises:
        ModelError: the displacement has another size.
    """
    motion = np.asarray(displacement, dtype=float)
    if motion.size != model.dof:
        raise ModelError(
            f"the displacement has {motion.size} values; the model has {model.dof} degrees of "
            "freedom, six a node"
        )
    motion = motion.reshape(-1, 6)
    shells = model.shells
    pick = np.arange(len(shells)) if chosen is None else np.asarray(chosen)
    nodes = shells.nodes[pick]
    frame = mean_planes(model.nodes[nodes])
    local = np.einsum("nij,nj->ni", to_local(frame), motion[nodes].reshape(len(pick), 24))
    factor = np.where(shells.group[pick] >= 0, np.append(theta, 1.0)[shells.group[pick]], 1.0)
    thickness, poisson_ratio = shells.thickness[pick], shells.poisson_ratio[pick]
    youngs_modulus = factor * shells.youngs_modulus[pick]
    strain = membrane_strain(frame.plane, thickness, youngs_modulus, poisson_ratio)
    elasticity = plane_stress(youngs_modulus, poisson_ratio)
    # Curvatures are those of u = z ry, v = -z rx, which stretch the upper face where positive.
    return ShellForces(
        _at_corners(thickness, elasticity, strain, local[:, IN_PLANE]),
        _at_corners(
            thickness**3 / 12.0, elasticity, plate_curvature(frame.plane), local[:, OUT_OF_PLANE]
        ),
        frame.axes,
        thickness,
    )


def _at_corners(factor: Floats, elasticity: Floats, strain: Floats, motion: Floats) -> Floats:
    """factor D strain motion, extrapolated from the Gauss points, (n, 4, 3)."""
    at_gauss = np.einsum("n,nij,ngjk,nk->ngi", factor, elasticity, strain, motion, optimize=True)
    return np.einsum("cg,ngi->nci", _TO_CORNERS, at_gauss)
