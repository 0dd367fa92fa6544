"""What the channels say of themselves before any model is believed: gains, signs, delays."""

import numpy as np
import torch

from femupdate.arrays import Complexes, Floats
from femupdate.discrepancy.thresholds import SCREEN
from femupdate.dynamics.system import System
from femupdate.measurement.observation import Observation, independent_share


def screen_channels(observation: Observation, system: System, theta: Floats) -> tuple[str, ...]:
    """Sentences on gains, signs and delays, from the low end of the FRFs.

    Well below the first frequency f1 a floor does what the base does: ln|H| = ln(gain) + c f^2,
    and the phase is zero, falling by 2 pi f times the delay. Where the base was measured to turn,
    that is beside what a rigid building does.

    Args:
        observation: on its grid.
        system: the model, for f1.
        theta: (p,) its stiffness factors.
    """
    count = system.sizes
    modes = system.modes(
        torch.from_numpy(np.atleast_2d(theta)),
        torch.zeros(1, count, dtype=torch.float64),
    )
    first = float(modes.frequency_hz[0, modes.participation[0, 0].abs().argmax()])
    low = observation.frequency_hz < SCREEN.low * first
    rigid = np.log(_rigid(observation, system))
    gains, foreign, turned, late = [], [], [], []
    # Neighbouring estimates repeat each other.
    repeated = independent_share(observation) ** -0.5
    for row, floor in enumerate(observation.floors):
        used = low & observation.valid[row]
        if used.sum() < SCREEN.fewest:
            continue
        frequency = observation.frequency_hz[used]
        weight = 1.0 / (repeated * observation.noise_sd[row, used])
        own = observation.log_frf[row, used] - rigid.real[row, used]
        gain, sd = _intercept(frequency**2, own, weight)
        if abs(gain) > max(SCREEN.clear * sd, SCREEN.wrong_unit):
            foreign.append(f"{floor} reads {np.exp(gain):.3g} times the base")
        elif frequency[-1] > SCREEN.lever * frequency[0] and abs(gain) > max(
            SCREEN.clear * sd, SCREEN.least_gain
        ):
            gains.append(f"{floor} reads {np.expm1(gain):+.1%}")
        if observation.phase is None:
            continue
        angle = np.angle(np.exp(1j * (observation.phase - rigid.imag)[row, used]))
        phase = np.unwrap(angle)
        if abs(np.median(np.abs(angle)) - np.pi) < SCREEN.turned:
            turned.append(floor)
            continue
        slope = float((weight**2 * frequency * phase).sum() / (weight**2 * frequency**2).sum())
        error = float((weight**2 * frequency**2).sum() ** -0.5)
        delay = -slope / (2.0 * np.pi)
        if abs(slope) > SCREEN.clear * error and abs(delay) > SCREEN.least_delay_s:
            sd = error / (2.0 * np.pi)
            late.append(f"{floor} {1e3 * delay:+.1f} ± {1e3 * sd:.1f} ms")
    return _sentences(gains, foreign, turned, late)


def _sentences(
    gains: list[str], foreign: list[str], turned: list[str], late: list[str]
) -> tuple[str, ...]:
    """What is told of floors with another gain, another unit, the other sign or a delay."""
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


def _rigid(observation: Observation, system: System) -> Complexes:
    """FRFs (f, m) of a rigid building on the base as it was measured."""
    turned = system.model.rotation
    if observation.rotation is None or turned is None:
        return np.ones(observation.log_frf.shape, dtype=np.complex128)
    levels = turned.levels[[system.floors.index(floor) for floor in observation.floors]]
    return np.asarray(1.0 + np.nan_to_num(observation.rotation) * levels[:, None])


def _intercept(x: Floats, y: Floats, weight: Floats) -> tuple[float, float]:
    """Value at x = 0 of a weighted straight line, and its standard deviation."""
    design = np.column_stack([np.ones_like(x), x]) * weight[:, None]
    normal = np.linalg.pinv(design.T @ design)
    value = normal @ (design.T @ (y * weight))
    return float(value[0]), float(np.sqrt(normal[0, 0]))
