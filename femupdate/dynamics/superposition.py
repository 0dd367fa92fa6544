"""Mode superposition of the full model at one theta: any base direction, any quantity of the nodes.

The modes up to a frequency follow the motion step by step, exactly for a ground acceleration that
is linear between its points. What the stiffer modes add is their static response (the mode
acceleration method; Cornwell, Craig and Johnson 1983, Earthq. Eng. Struct. Dyn. 11).
"""

from dataclasses import dataclass

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.dynamics.recurrence import interpolate_record, modal_states
from femupdate.errors import ModelError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.mechanism import factorize_held
from femupdate.fe.solve import modes_below

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def base_direction(direction: str | float) -> Floats:
    """Return the unit vector (3,) of a base motion.

    Args:
        direction: "x", "y", "z", or an angle in degrees from x towards y.

    Raises:
        ModelError: another name, or an angle that is not finite.
    """
    if isinstance(direction, str):
        if direction not in _AXES:
            raise ModelError(
                f"direction {direction!r} is unknown; write x, y, z or an angle in degrees from x "
                "towards y"
            )
        return np.array(_AXES[direction])
    if not np.isfinite(direction):
        raise ModelError(f"the angle {direction} of the base motion must be finite")
    angle = np.radians(direction)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


@dataclass(frozen=True)
class Superposition:
    """The modes of a structure under a base motion in one direction.

    Attributes:
        omega: (m,) rad/s.
        shapes: (n_free, m) mode shapes, scaled to a participation of one.
        missed: (n_free,) what these lack of the static displacement under a unit of base
            acceleration against the direction, s2.
    """

    omega: Floats
    shapes: Floats
    missed: Floats


def superpose(
    operators: AffineOperators, theta: Floats, direction: str | float, top_hz: float
) -> Superposition:
    """Find the modes that follow a base motion.

    Args:
        theta: (p,) stiffness factors.
        direction: as for `base_direction`.
        top_hz: all modes below this frequency are kept.

    Raises:
        ModelError: the structure is a mechanism, or the direction is unknown.
    """
    parts = zip(base_direction(direction), range(3), strict=True)
    everything = sum(share * operators.rigid_translation(axis) for share, axis in parts)
    force = operators.gather(operators.mass_full @ everything)
    factorization = factorize_held(operators, operators.stiffness(theta))
    modes = modes_below(operators, theta, top_hz, factorization)
    participation = modes.shapes.T @ force
    # Modes that the motion does not drive at all add nothing, in any direction of the output.
    shapes, omega = modes.shapes * participation, 2.0 * np.pi * modes.frequency_hz
    static = factorization.solve(force)
    return Superposition(
        omega=omega,
        shapes=shapes,
        missed=static - shapes @ omega**-2.0,
    )


@dataclass(frozen=True)
class BaseMotion:
    """An acceleration history of the base.

    Attributes:
        acceleration: (n,) m/s2.
        time_step: s.
        oversampling: points a step at which the motion between the samples is followed.
    """

    acceleration: Floats
    time_step: float
    oversampling: int = 8


def displacement_history(
    structure: Superposition, rows: Floats, zeta: float | Floats, motion: BaseMotion
) -> Floats:
    """Return quantities that are linear in the displacement relative to the base, (o, n).

    Args:
        structure: modes in the direction of the motion.
        rows: (o, n_free) shares of the displacements, such as a floor's mean, or a member's forces.
        zeta: damping ratio of all modes, or (m,) one for each.

    Returns:
        histories (o, n) in the unit of `rows` times m; from rest.
    """
    omega, states = structure.omega, _states(structure, zeta, motion)
    seen = rows @ structure.shapes
    history = np.concatenate([_first(block, omega) for block in states]).T
    missed = (rows @ structure.missed)[:, None] * -motion.acceleration
    return np.asarray(seen @ history + missed)


def _states(
    structure: Superposition, zeta: float | Floats, motion: BaseMotion
) -> list[torch.Tensor]:
    """States (t, 1, 2, m) of the modes, block by block."""
    omega = torch.from_numpy(structure.omega)[None]
    ratio = torch.from_numpy(np.broadcast_to(zeta, structure.omega.shape).astype(float))[None]
    fine = torch.from_numpy(interpolate_record(motion.acceleration, motion.oversampling))
    blocks = modal_states(omega, ratio, fine, motion.time_step, motion.oversampling)
    return list(blocks)


def _first(block: torch.Tensor, omega: Floats) -> Floats:
    """Modal displacements (t, m) of a block of states."""
    return np.asarray(block[:, 0, 0].numpy() / omega)
