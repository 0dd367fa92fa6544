"""Responses of the full model by superposition of its modes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femupdate.fe.assembly import AffineOperators
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.solve import modes_below, static_displacement

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FloorSensors:
    """Where the floors are observed and how the base moves.

    Attributes:
        rows: (f, n_free) mean displacement of each floor's sensor points along the motion.
        excitation: (n_free,) force of inertia per unit base acceleration, kg and kg m.
        direction: 0 for motion along x, 1 along y.
    """

    rows: Floats
    excitation: Floats
    direction: int


@dataclass(frozen=True)
class FloorModes:
    """The modes of the full model as its floors feel them, at one theta.

    Attributes:
        omega: (m,) circular frequencies, rad/s.
        effect: (f, m) floor shape times participation factor.
        missed: (f,) static displacement of the floors under unit base acceleration that the modes
            lack, s2.
    """

    omega: Floats
    effect: Floats
    missed: Floats

    def log_frf(self, frequency_hz: Floats, zeta: float) -> Floats:
        """ln|H| (f, k) at the frequencies (k,), Hz, for one damping ratio of all modes."""
        return superposition_log_frf(self.omega, self.effect, self.missed, frequency_hz, zeta)


@dataclass(frozen=True)
class FullModes:
    """Modes of the full model at one theta, with the static response.

    Attributes:
        shapes: (n_free, m) M-orthonormal.
        participation: (m,) participation factors.
        floors: (f, m) floor shapes.
        static: (n_free,) displacement under unit base acceleration, s2.
        felt: what the floors feel of them.
    """

    shapes: Floats
    participation: Floats
    floors: Floats
    static: Floats
    felt: FloorModes


def floor_sensors(
    operators: AffineOperators, floor_nodes: Mapping[str, NDArray[np.int64]], direction: int
) -> FloorSensors:
    """Sensors of all floors, each the mean over its nodes."""
    rows = np.zeros((len(floor_nodes), operators.dof))
    for row, nodes in zip(rows, floor_nodes.values(), strict=True):
        row[DOF_PER_NODE * np.asarray(nodes) + direction] = 1.0 / len(nodes)
    return FloorSensors(rows[:, operators.free], operators.inertia(direction), direction)


def full_modes(
    operators: AffineOperators, sensors: FloorSensors, theta: Floats, top_hz: float
) -> FullModes:
    """All modes up to a frequency, and the static response that makes up for the rest.

    Raises:
        ModelError: the structure is a mechanism, or the eigenproblem cannot be solved.
    """
    modes = modes_below(operators, theta, top_hz)
    omega = 2.0 * np.pi * modes.frequency_hz
    participation = modes.shapes.T @ sensors.excitation
    floors = sensors.rows @ modes.shapes
    load = operators.expand(sensors.excitation)
    static = operators.restrict(static_displacement(operators, theta, load))
    effect = floors * participation
    missed = sensors.rows @ static - effect @ omega**-2.0
    return FullModes(modes.shapes, participation, floors, static, FloorModes(omega, effect, missed))


def superposition_log_frf(
    omega: Floats, effect: Floats, static: Floats, frequency_hz: Floats, zeta: float
) -> Floats:
    """ln|H| (f, k) from the modes of one model, with a static correction for those left out.

    Args:
        omega: (m,) rad/s.
        effect: (f, m) floor shape times participation factor.
        static: (f,) displacement under unit base acceleration that the modes miss, s2.
        frequency_hz: (k,).
        zeta: damping ratio of all modes.
    """
    w = 2.0 * np.pi * frequency_hz
    flexibility = omega[:, None] ** 2 - w**2 + 2j * zeta * omega[:, None] * w
    response = 1.0 + effect @ (w**2 / flexibility) + static[:, None] * w**2
    return np.log(np.abs(response))
