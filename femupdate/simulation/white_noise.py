"""Band-limited white noise as the motion of a base."""

import numpy as np

from femupdate.errors import MeasurementError
from femupdate.measurement.record import GroundMotion

_RAMP_S = 1.0  # a table starts and stops smoothly


def white_noise(
    duration_s: float,
    sampling_hz: float,
    rms: float,
    band_hz: tuple[float, float],
    rng: np.random.Generator,
) -> GroundMotion:
    """Return Gaussian noise of an even spectrum within a band and nothing outside it.

    The noise has just the given rms (m/s2) before its first and last second rise from and fall to
    zero by half a cosine.

    Raises:
        MeasurementError: the record is too short for the band.
    """
    count = round(duration_s * sampling_hz)
    frequency = np.fft.rfftfreq(count, 1.0 / sampling_hz)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    ramp = round(_RAMP_S * sampling_hz)
    if np.count_nonzero(inside) < 2 or count < 4 * ramp:
        raise MeasurementError(
            f"{duration_s:g} s are too short for white noise from {band_hz[0]:g} to "
            f"{band_hz[1]:g} Hz; take {4 * _RAMP_S:g} s or more"
        )
    noise = np.fft.irfft(np.where(inside, np.fft.rfft(rng.standard_normal(count)), 0.0), count)
    noise *= rms / np.sqrt(np.mean(noise**2))
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    noise[:ramp] *= rise
    noise[-ramp:] *= rise[::-1]
    return GroundMotion(noise, 1.0 / sampling_hz, "white noise")
