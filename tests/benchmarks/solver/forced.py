"""Forced vibration of plates by mode superposition: NAFEMS 13H, 13T and 21H.

After NAFEMS, "Selected benchmarks for forced vibration" (R0016, 1989), as quoted in the
verification manual of Abaqus: the plates of FV13 and FV21 under a uniform pressure, 2 % damping in
each of the 16 lowest modes.
"""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.fe import assemble, lowest_modes

from .meshes import UZ, area_shares
from .shell_forces import shell_forces
from .vibrations import square_plate

MODES, ZETA = 16, 0.02
_STEP_S = 0.002


@dataclass(frozen=True)
class PlateModes:
    """What the middle of the plate sees of each mode.

    Attributes:
        omega: (m,) rad/s.
        displacement: (m,) of the middle when the pressure acts on the mode statically, m s2.
        stress: (m,) likewise the stress of the upper face along x, Pa s2.
    """

    omega: Floats
    displacement: Floats
    stress: Floats


@dataclass(frozen=True)
class Peak:
    """The largest response of the middle.

    Attributes:
        displacement: m.
        stress: Pa.
        at: frequency in Hz, or time in s.
    """

    displacement: float
    stress: float
    at: float


def plate_modes(count: int, thickness: float, pressure: float) -> PlateModes:
    """Modes of the simply supported plate of count x count elements, an even number."""
    plate = square_plate(count, thickness, "hard")
    operators = assemble(plate)
    modes = lowest_modes(operators, np.ones(1), MODES)
    shapes = operators.expand(modes.shapes).reshape(-1, 6, MODES)
    force = pressure * shapes[:, UZ].T @ area_shares(plate.nodes, plate.faces)
    middle = int(np.linalg.norm(plate.nodes - [5.0, 5.0, 0.0], axis=1).argmin())
    around = np.flatnonzero((plate.faces == middle).any(axis=1))
    corner = plate.faces[around] == middle
    stress = np.array(
        [
            shell_forces(plate, shapes[..., mode], np.ones(1), around)
            .stress(face=1.0)[corner][:, 0]
            .mean()
            for mode in range(MODES)
        ]
    )
    omega = 2.0 * np.pi * modes.frequency_hz
    return PlateModes(omega, shapes[middle, UZ] * force, stress * force)


def harmonic_peak(modes: PlateModes) -> Peak:
    """Peak amplitude over frequency under a harmonic pressure, near the first mode (13H, 21H)."""
    omega = modes.omega[0] * np.linspace(0.99, 1.01, 2001)[:, None]
    transfer = 1.0 / (modes.omega**2 - omega**2 + 2j * ZETA * modes.omega * omega)
    displacement = np.abs(transfer @ modes.displacement)
    stress = np.abs(transfer @ modes.stress)
    top = int(displacement.argmax())
    return Peak(float(displacement[top]), float(stress.max()), float(omega[top, 0] / 2.0 / np.pi))


def step_peak(modes: PlateModes) -> Peak:
    """Peak over time under a pressure that stays from t = 0 on, every 2 ms (13T)."""
    time = np.arange(0.0, 1.0, _STEP_S)[:, None]
    damped = modes.omega * np.sqrt(1.0 - ZETA**2)
    decay = np.exp(-ZETA * modes.omega * time)
    ring = np.cos(damped * time) + ZETA / np.sqrt(1.0 - ZETA**2) * np.sin(damped * time)
    response = (1.0 - decay * ring) / modes.omega**2
    displacement = response @ modes.displacement
    top = int(displacement.argmax())
    return Peak(
        float(displacement[top]), float((response @ modes.stress).max()), float(time[top, 0])
    )


def static_value(modes: PlateModes) -> float:
    """Static deflection of the middle by the modes kept, m."""
    return float((modes.displacement / modes.omega**2).sum())


def first_mode_only(modes: PlateModes) -> PlateModes:
    """The same plate with its lowest mode alone, as the published closed form of 13T has it."""
    return PlateModes(modes.omega[:1], modes.displacement[:1], modes.stress[:1])
