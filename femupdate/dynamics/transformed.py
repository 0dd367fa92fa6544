"""Histories by the Fourier transform, for what no recurrence mode by mode follows.

Dampers and appendages make modes complex, a base that pitches turns with its displacement, and
instruments are known by their FRFs: the response is the inverse Fourier transform of the FRFs times
the record's spectrum, with silence behind the record until the motion has died down. For a linear
structure that is exact.
"""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.modes import response
from femupdate.dynamics.story import story_rows
from femupdate.dynamics.system import System

REST = 1e-4  # share to which motion has decayed behind the record
_SHORTEST_S, _LONGEST_S = 5.0, 600.0
_BLOCK = 2048  # frequencies at a time


def transformed_outputs(
    system: System, sample: tuple[Tensor, Tensor, Tensor], record: Floats, time_step: float
) -> Floats:
    """Floor accelerations, story shears and story drifts (f + 2 s, n) as they happen.

    Args:
        system: the structure with effects; what only its instruments do is left out.
        sample: theta (1, p), zeta (1,) and sizes (1, q).
        record: (n,) base acceleration, m/s2.
        time_step: s.
    """
    theta, zeta, sizes = sample
    rows = story_rows(system, sizes)
    modes = system.modes(theta, sizes, rows)
    ratio = system.ratio(modes.omega, zeta, sizes)

    def outputs(omega: Tensor) -> Tensor:
        frf = response(modes, ratio, omega, system.port_stiffness(omega, sizes))[0]
        floors, stories = len(system.floors), len(system.model.story_mass)
        of_floor, of_inertia, of_drift = frf.split([floors, stories, stories])
        return torch.cat([of_floor, -of_inertia, -of_drift / omega**2])

    rest = _rest(modes.omega, ratio, REST)
    return _transformed(outputs, record, time_step, rest)


def transformed_sensors(
    system: System,
    sample: tuple[Tensor, Tensor, Tensor],
    record: Floats,
    time_step: float,
    share: float = REST,
) -> Floats:
    """Accelerations (f, n), m/s2, as the sensors give them.

    Arguments are those of `transformed_outputs`; behind the record motion decays to a share.
    """
    theta, zeta, sizes = sample
    modes = system.modes(theta, sizes)
    rest = _rest(modes.omega, system.ratio(modes.omega, zeta, sizes), share)

    def sensors(omega: Tensor) -> Tensor:
        return system.frf(theta, zeta, sizes, omega / (2.0 * torch.pi))[0]

    return _transformed(sensors, record, time_step, rest)


def _transformed(
    frf: Callable[[Tensor], Tensor], record: Floats, time_step: float, rest: float
) -> Floats:
    samples = len(record)
    padded = samples + round(rest / time_step)
    spectrum = np.fft.rfft(record, padded)
    frequency = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    frequency[0] = 1e-3 * frequency[1]  # the rigid limit, without a division by zero
    blocks = np.array_split(2.0 * np.pi * frequency, max(1, len(frequency) // _BLOCK))
    values = torch.cat([frf(torch.from_numpy(block)) for block in blocks], dim=1).numpy()
    return np.asarray(np.fft.irfft(values * spectrum, padded, axis=1)[:, :samples])


def _rest(omega: Tensor, ratio: Tensor, share: float) -> float:
    """How long motion lasts behind the record, s."""
    rate = float((omega * ratio).min())  # of decay, 1/s
    return float(np.clip(-np.log(share) / rate, _SHORTEST_S, _LONGEST_S))
