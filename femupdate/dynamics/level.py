"""How strong a motion is, in one number that records of any length can be compared by."""

import numpy as np

from femupdate.arrays import Floats

_STRONG = 0.05, 0.95  # of the energy, between which a motion is strong
PERIODS = 4.0  # of the strongest mode, over which the level of a moment is taken


def motion_level(acceleration: Floats) -> Floats:
    """Root mean square of the strong part of each motion, (...,) of (..., n).

    The strong part holds the middle 90 % of the integral of the squared acceleration (Trifunac and
    Brady, Bull. Seism. Soc. Am. 65, 1975), so that silence before and after it does not count.
    """
    energy = np.cumsum(np.asarray(acceleration, dtype=np.float64) ** 2, axis=-1)
    total = energy[..., -1:]
    inside = (energy >= _STRONG[0] * total) & (energy <= _STRONG[1] * total)
    samples = np.maximum(inside.sum(axis=-1), 1)
    share = _STRONG[1] - _STRONG[0]
    return np.asarray(np.sqrt(share * total[..., 0] / samples))


def strongest_hz(floors: Floats, time_step: float) -> float:
    """Frequency at which floors (f, n) move most."""
    from scipy.signal import welch

    # Segments of 20 s tell the strongest mode.
    length = min(floors.shape[1], round(20.0 / time_step))
    frequency, power = welch(floors, 1.0 / time_step, nperseg=length)
    return float(frequency[1 + power[:, 1:].sum(axis=0).argmax()])
