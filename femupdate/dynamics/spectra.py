"""Response spectra of histories, such as the accelerations of floors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.dynamics.recurrence import interpolate_record, step_matrices
from femupdate.dynamics.summary import Statistics, statistics
from femupdate.tables import Table

_SPECTRUM_HZ, _SPECTRUM_POINTS = (0.2, 40.0), 120


@dataclass(frozen=True)
class FloorSpectra:
    """Response spectra of floors: peak absolute acceleration of oscillators that stand there."""

    frequency_hz: Floats  # (k,) of the oscillators
    damping: float  # their damping ratio
    acceleration: Statistics  # (f, k) statistics over the samples, m/s2
    base: Floats  # (k,) of the ground motion itself, m/s2

    def as_dict(self, floors: Sequence[str]) -> dict[str, Any]:
        """What `--json` holds."""
        return {
            "frequency_hz": self.frequency_hz,
            "damping": self.damping,
            "base_m_s2": self.base,
            "floors_m_s2": self.acceleration.by_name(floors),
        }

    def table(self, floors: Sequence[str]) -> Table:
        """The peak of every floor's mean spectrum, and where it lies."""
        mean = self.acceleration.mean
        rows = [
            (floor, f"{spectrum.max():.3f}", f"{self.frequency_hz[spectrum.argmax()]:.3g}")
            for floor, spectrum in zip(floors, mean, strict=True)
        ]
        head = (f"spectrum, {100.0 * self.damping:.3g} %", "peak, m/s²", "at, Hz")
        return Table.of(head, rows, caption="Peaks of the mean floor spectra")


def floor_spectra(floors: Floats, base: Floats, time_step: float, damping: float) -> FloorSpectra:
    """Return the response spectra of floors and base, up to .4 times the sampling rate.

    Args:
        floors: (S, f, n) absolute accelerations, m/s2, from rest.
        base: (n,) of the ground, m/s2.
    """
    top = min(_SPECTRUM_HZ[1], 0.4 / time_step)
    frequency = np.geomspace(_SPECTRUM_HZ[0], top, _SPECTRUM_POINTS)
    of_floors = statistics(response_spectrum(floors, time_step, frequency, damping))
    of_base = response_spectrum(base, time_step, frequency, damping)
    return FloorSpectra(frequency, damping, of_floors, of_base)


def response_spectrum(
    acceleration: ArrayLike, time_step: float, frequency_hz: ArrayLike, zeta: float = 0.05
) -> Floats:
    """Return the peak absolute acceleration (..., k) of oscillators on a support that moves.

    Each oscillator is followed exactly for an acceleration that is linear between points (Nigam
    and Jennings 1969), of which there are twelve a period or more.

    Args:
        acceleration: (..., n) absolute acceleration of the supports, m/s2, from rest.
    """
    import torch
    from scipy.signal import lfilter

    histories = np.asarray(acceleration, dtype=np.float64)
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    peaks = np.zeros((*histories.shape[:-1], len(frequency)))
    flat, found = histories.reshape(-1, histories.shape[-1]), peaks.reshape(-1, len(frequency))
    # Between twelve points a period a peak is missed by 1 - cos(pi / 12), 3.4 %, at most; a step is
    # divided into sixteen at most.
    points = np.ceil(12 * frequency * time_step).clip(1, 16).astype(int)
    for factor in np.unique(points):
        fine = np.stack([interpolate_record(row, int(factor)) for row in flat])
        chosen = np.flatnonzero(points == factor)
        omega = torch.from_numpy(2.0 * np.pi * frequency[chosen])
        ratio = torch.full_like(omega, zeta)
        steps = step_matrices(omega, ratio, time_step / int(factor))
        for k, transition, load in zip(chosen, *(s.numpy() for s in steps), strict=True):
            numerator, denominator = _filter(transition, load, 2 * np.pi * frequency[k], zeta)
            found[:, k] = np.abs(lfilter(numerator, denominator, fine, axis=-1)).max(axis=-1)
    return peaks


def _filter(transition: Floats, load: Floats, omega: float, zeta: float) -> tuple[Floats, Floats]:
    """The recurrence of one oscillator as a filter from ground to absolute acceleration.

    The state is (omega x, x'); the absolute acceleration is -omega (omega x) - 2 zeta omega x'.
    """
    outputs = -omega * np.array([1.0, 2.0 * zeta])
    denominator = np.array([1.0, -np.trace(transition), np.linalg.det(transition)])
    # Response to a unit sample: its first three values fix the numerator.
    state = load[:, 1]
    impulse = [outputs @ state]
    state = transition @ state + load[:, 0]
    impulse.append(outputs @ state)
    impulse.append(outputs @ (transition @ state))
    return np.convolve(denominator, impulse)[:3], denominator
