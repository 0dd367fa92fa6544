"""Histories by the Fourier transform, for what no recurrence mode by mode follows.

Dampers and appendages make modes complex, and instruments are known by their FRFs: the response is
the inverse Fourier transform of the FRFs times the record's spectrum, with silence behind the
record until the motion has died down. For a linear structure that is exact.
"""

from collections.abc import Callable
from dataclasses import replace

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
        record: (n,) acceleration of the base along what the system's responses are taken to.
        time_step: s.

    Drifts are those against the base as it turns: its tilt strains no story.
    """
    theta, zeta, sizes = sample
    rows = story_rows(system, sizes)
    floors, stories = len(system.floors), len(system.model.story_mass)
    modes = system.modes(theta, sizes, rows)
    direct = modes.direct.clone()
    direct[:, floors + stories : floors + 2 * stories] = 0.0
    modes = replace(modes, direct=direct)
    ratio = system.ratio(modes.omega, zeta, sizes)

    def outputs(omega: Tensor) -> Tensor:
        frf = response(modes, ratio, omega, system.port_stiffness(omega, sizes))[0]
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

    Args:
        system, sample, time_step: see `transformed_outputs`.
        record: (n,) base acceleration, m/s2, or (2, n) with its rotation, rad/s2, below.
        share: to which motion decays behind the record.
    """
    theta, zeta, sizes = sample
    modes = system.modes(theta, sizes)
    rest = _rest(modes.omega, system.ratio(modes.omega, zeta, sizes), share)

    def respond(moved: System, own: Floats) -> Floats:
        def sensors(omega: Tensor) -> Tensor:
            return moved.frf(theta, zeta, sizes, omega / (2.0 * torch.pi))[0]

        return _transformed(sensors, own, time_step, rest)

    parts = zip((system, system.turned), np.atleast_2d(record), strict=False)
    return np.sum([respond(moved, own) for moved, own in parts], axis=0)


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
