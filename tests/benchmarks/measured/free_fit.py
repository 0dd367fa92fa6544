"""A free linear modal fit of measured floors: what modes that no building ties would predict."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from femupdate.arrays import Floats
from femupdate.measurement import Histories
from femupdate.measurement.names import BASE

_GRID = 200  # frequencies at which a mode is tried
_DAMPING = (0.005, 0.02, 0.06)
_LIMITS = (5e-4, 0.3)  # of damping ratios


@dataclass(frozen=True)
class FreeFit:
    """Modes with frequencies, damping ratios and participations of their own."""

    # frequency_hz, damping: (m,)
    frequency_hz: Floats
    damping: Floats
    participation: Floats  # (m, f) of the floors' motion against the base

    def error(self, measured: Histories, direction: str) -> Floats:
        """Rms of predicted less measured accelerations over that of the measured, (f,)."""
        base, floors = channels(measured, direction)
        answer = self.answer(base, measured.time_step)
        missed = ((answer - floors) ** 2).mean(axis=1) / (floors**2).mean(axis=1)
        return np.asarray(np.sqrt(missed))

    def answer(self, base: Floats, time_step: float) -> Floats:
        """Floors (f, n) under a motion (1, n) of the base."""
        count = base.shape[-1]
        frequency = _frequencies(count, time_step)
        moved = _modes(frequency, self.frequency_hz, self.damping) * np.fft.rfft(base, 2 * count)
        return base + np.fft.irfft(self.participation.T @ moved, 2 * count)[:, :count]


def fit_free(
    events: Sequence[Histories], direction: str, band_hz: tuple[float, float], modes: int
) -> FreeFit:
    """Fit so many modes to the Fourier transforms of events, every floor weighing alike."""
    spectra = [_spectra(one, direction, band_hz) for one in events]
    found: list[tuple[float, float]] = []
    for _ in range(modes):
        tried = [
            [*found, (hertz, ratio)]
            for hertz in np.geomspace(*band_hz, _GRID)
            for ratio in _DAMPING
        ]
        found = min(tried, key=lambda own: float((_solve(spectra, np.array(own))[1] ** 2).sum()))
    low, high = np.log([(band_hz[0], _LIMITS[0]), (band_hz[1], _LIMITS[1])])
    ended = least_squares(
        lambda logs: _solve(spectra, np.exp(logs).reshape(-1, 2))[1],
        np.clip(np.log(found), low, high).ravel(),
        bounds=(np.tile(low, modes), np.tile(high, modes)),
        x_scale=0.01,
    )
    own = np.exp(ended.x).reshape(-1, 2)
    return FreeFit(own[:, 0], own[:, 1], _solve(spectra, own)[0])


_Spectra = tuple[Floats, Floats, Floats]


def _spectra(one: Histories, direction: str, band_hz: tuple[float, float]) -> _Spectra:
    """Frequencies (k,), the base (k,) and the floors against it (f, k), these of unit rms."""
    base, floors = channels(one, direction)
    frequency = _frequencies(one.acceleration.shape[1], one.time_step)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    size = np.sqrt(((floors - base) ** 2).sum(axis=1, keepdims=True))
    transformed = np.fft.rfft(np.vstack([base, floors - base]), 2 * base.shape[-1])[:, inside]
    return frequency[inside], transformed[:1] / size, transformed[1:] / size


def _solve(spectra: Sequence[_Spectra], modes: Floats) -> tuple[Floats, Floats]:
    """Participations (m, f) that are best for modes (m, 2), and the residuals that they leave."""
    parts, left = [], []
    floors = len(spectra[0][2])
    for k in range(floors):
        columns = [_modes(f, *modes.T) * base[k] for f, base, _ in spectra]
        wide = np.concatenate([np.hstack([one.real, one.imag]) for one in columns], axis=1).T
        seen = np.concatenate([np.hstack([own[k].real, own[k].imag]) for _, _, own in spectra])
        parts.append(np.linalg.lstsq(wide, seen, rcond=None)[0])
        left.append(seen - wide @ parts[-1])
    return np.array(parts).T, np.concatenate(left)


def _modes(frequency: Floats, hertz: Floats, damping: Floats) -> Floats:
    """Accelerations (m, k) of oscillators against a base of unit acceleration."""
    own, turning = hertz[:, None], frequency[None]
    return turning**2 / (own**2 - turning**2 + 2j * damping[:, None] * own * turning)


def _frequencies(count: int, time_step: float) -> Floats:
    """Of the transform of a record with as many zeros behind it, Hz."""
    return np.asarray(np.fft.rfftfreq(2 * count, time_step), np.float64)


def channels(one: Histories, direction: str) -> tuple[Floats, Floats]:
    """The base (1, n) and the floors (f, n), sensors averaged."""
    mean = [
        one.acceleration[one.rows(name, direction)].mean(axis=0) for name in (BASE, *one.floors)
    ]
    return np.array(mean[:1]), np.array(mean[1:])
