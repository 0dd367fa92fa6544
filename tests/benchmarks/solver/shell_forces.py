"""Forces and stresses inside shells, against those of textbooks."""

from dataclasses import dataclass

from femupdate.arrays import Floats, Integers
from femupdate.fe import FiniteElementModel, Shells, element_forces
from femupdate.fe.elements.shell import mean_planes


@dataclass(frozen=True)
class ShellForces:
    """Resultants at the corners of shells, in the axes of each; see `Shells`.

    Attributes:
        membrane: (n, 4, 3) forces per length n_x, n_y, n_xy, N/m.
        moment: (n, 4, 3) moments per length m_x, m_y, m_xy, N.
        axes: (n, 3, 3) rows are the local x, y and z axes.
        thickness: (n,) m.
    """

    membrane: Floats
    moment: Floats
    axes: Floats
    thickness: Floats

    def stress(self, face: float = 0.0) -> Floats:
        """Stresses (n, 4, 3) sigma_x, sigma_y, tau_xy, Pa."""
        thickness = self.thickness[:, None, None]
        return self.membrane / thickness + 6.0 * face * self.moment / thickness**2


def shell_forces(
    model: FiniteElementModel, displacement: Floats, theta: Floats, chosen: Integers | None = None
) -> ShellForces:
    """Forces of a model's four-node shells; arguments and errors as for `element_forces`."""
    shells = model.elements_of(Shells)
    forces = element_forces(model, shells, displacement, theta, chosen).reshape(-1, 4, 6)
    own = shells if chosen is None else shells.taken(chosen)
    axes = mean_planes(own.corners(model.nodes)).axes
    return ShellForces(forces[..., :3], forces[..., 3:], axes, own.thickness)
