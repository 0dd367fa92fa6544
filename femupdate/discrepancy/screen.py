"""What the channels say of themselves before any model is believed: gains, signs, delays."""

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.dynamics.system import System
from femupdate.measurement.observation import Observation, independent_share

_CLEAR = 3.0  # standard deviations from which a gain or a delay is told


def screen_channels(observation: Observation, system: System, theta: Floats) -> tuple[str, ...]:
    """Sentences on gains, signs and delays, from the low end of the FRFs.

    Well below the first frequency f1 a floor does what the base does: ln|H| = ln(gain) + c f^2,
    and the phase is zero, falling by 2 pi f times the delay. Where the base was measured to turn,
    that is beside what a rigid building does. theta (p,) serves to find f1.
    """
    modes = system.modes(
        torch.from_numpy(np.atleast_2d(theta)), torch.zeros(1, system.sizes, dtype=torch.float64)
    )
    first = float(modes.frequency_hz[0, modes.participation[0, 0].abs().argmax()])
    low = observation.frequency_hz < 0.35 * first
    rigid, turning = np.zeros(observation.log_frf.shape, dtype=np.complex128), system.model.rotation
    if observation.rotation is not None and turning is not None:
        levels = turning.levels[[system.floors.index(floor) for floor in observation.floors]]
        rigid = np.log(1.0 + np.nan_to_num(observation.rotation) * levels[:, None])
    gains, foreign, turned, late = [], [], [], []
    # Neighbouring estimates repeat each other.
    repeated = independent_share(observation) ** -0.5
    for row, floor in enumerate(observation.floors):
        used = low & observation.valid[row]
        if used.sum() < 4:
            continue
        frequency = observation.frequency_hz[used]
        weight = 1.0 / (repeated * observation.noise_sd[row, used])
        # The value at f = 0 of a weighted straight line over f^2.
        design = np.column_stack([np.ones_like(frequency), frequency**2]) * weight[:, None]
        normal = np.linalg.pinv(design.T @ design)
        low_end = (observation.log_frf[row, used] - rigid.real[row, used]) * weight
        gain, sd = float((normal @ (design.T @ low_end))[0]), float(normal[0, 0] ** 0.5)
        if abs(gain) > max(_CLEAR * sd, np.log(2.0)):
            foreign.append(f"{floor} reads {np.exp(gain):.3g} times the base")
        elif frequency[-1] > 2.0 * frequency[0] and abs(gain) > max(_CLEAR * sd, 0.02):
            gains.append(f"{floor} reads {np.expm1(gain):+.1%}")
        if observation.phase is None:
            continue
        angle = np.angle(np.exp(1j * (observation.phase - rigid.imag)[row, used]))
        if abs(np.median(np.abs(angle)) - np.pi) < 0.5:
            turned.append(floor)
            continue
        error = float((weight**2 * frequency**2).sum() ** -0.5) / (2.0 * np.pi)
        slope = (weight**2 * frequency * np.unwrap(angle)).sum() * 2.0 * np.pi * error**2
        if abs(slope) > max(_CLEAR * error, 5e-4):
            late.append(f"{floor} {-1e3 * slope:+.1f} ± {1e3 * error:.1f} ms")
    notes = []
    if gains:
        notes.append(f"At low frequency, where floors follow the base, {', '.join(gains)}.")
    if foreign:
        notes.append(
            f"At low frequency, where floors follow the base, {', '.join(foreign)}: a wrong unit "
            "(1 g is 9.81 m/s2, 1 m/s2 is 100 gal) or a wrong channel?"
        )
    if turned:
        notes.append(f"The phase of {', '.join(turned)} is half a turn off: sensor reversed?")
    if late:
        notes.append(f"Phase falls at low frequency as for a delay: {', '.join(late)}.")
    return tuple(notes)
