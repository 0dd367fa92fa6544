"""Responses of the full model by superposition of its modes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.factorization import Factorization
from femupdate.fe.mechanism import factorize_held
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.solve import modes_below


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
        missed: (f, t) what the modes lack of the floors' displacement under unit base
            acceleration: first terms of its power series in the squared frequency, s2, s4, ...
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
    operators: AffineOperators, floor_nodes: Mapping[str, Integers], direction: int
) -> FloorSensors:
    """Sensors of all floors, each the mean over its nodes."""
    rows = np.zeros((len(floor_nodes), operators.dof))
    for row, nodes in zip(rows, floor_nodes.values(), strict=True):
        row[DOF_PER_NODE * np.asarray(nodes) + direction] = 1.0 / len(nodes)
    seen = operators.gather(rows.T).T
    return FloorSensors(seen, operators.inertia(direction), direction)


def full_modes(
    operators: AffineOperators,
    sensors: FloorSensors,
    theta: Floats,
    top_hz: float,
    terms: int = 1,
) -> FullModes:
    """All modes up to a frequency, and the power series that makes up for the rest.

    At a share s of the top, t terms leave s^(2 t) of what the other modes do statically.

    Args:
        operators: of the full model.
        sensors: where the floors are observed.
        theta: (p,) stiffness factors.
        top_hz: all modes below it are found.
        terms: of the power series, at least one: the static response.

    Raises:
        ModelError: the structure is a mechanism, or the eigenproblem cannot be solved.
    """
    factorization = factorize_held(operators, operators.stiffness(theta))
    modes = modes_below(operators, theta, top_hz, factorization)
    omega = 2.0 * np.pi * modes.frequency_hz
    return _seen(operators, sensors, omega, modes.shapes, factorization, terms)


def _seen(
    operators: AffineOperators,
    sensors: FloorSensors,
    omega: Floats,
    shapes: Floats,
    factorization: Factorization,
    terms: int,
) -> FullModes:
    """What the floors feel of modes (n_free, m) of circular frequencies (m,)."""
    participation = shapes.T @ sensors.excitation
    floors = sensors.rows @ shapes
    effect = floors * participation
    rest = _power_series(operators, factorization, shapes, sensors.excitation, terms)
    static = shapes @ (participation / omega**2) + rest[:, 0]
    felt = FloorModes(omega, effect, sensors.rows @ rest)
    return FullModes(shapes, participation, floors, static, felt)


def _power_series(
    operators: AffineOperators,
    factorization: Factorization,
    shapes: Floats,
    force: Floats,
    terms: int,
) -> Floats:
    """(K^-1 M)^k K^-1 force (n_free, terms) without the part of the given modes (n_free, m)."""
    force = force - operators.mass @ (shapes @ (shapes.T @ force))
    series = []
    for _ in range(terms):
        motion = factorization.solve(force)
        # Rounding brings the modes back, and every further term would magnify them.
        motion = motion - shapes @ (shapes.T @ (operators.mass @ motion))
        series.append(motion)
        force = operators.mass @ motion
    return np.column_stack(series)


def superposition_log_frf(
    omega: Floats, effect: Floats, missed: Floats, frequency_hz: Floats, zeta: float
) -> Floats:
    """ln|H| (f, k) from the modes of one model, with a power series for those left out.

    Args:
        omega: (m,) rad/s.
        effect: (f, m) floor shape times participation factor.
        missed: (f, t) power series of the displacement that the modes miss, s2, s4, ...
        frequency_hz: (k,).
        zeta: damping ratio of all modes.
    """
    w = 2.0 * np.pi * frequency_hz
    flexibility = omega[:, None] ** 2 - w**2 + 2j * zeta * omega[:, None] * w
    powers = w ** (2 * np.arange(missed.shape[1])[:, None] + 2)
    response = 1.0 + effect @ (w**2 / flexibility) + missed @ powers
    return np.log(np.abs(response))
