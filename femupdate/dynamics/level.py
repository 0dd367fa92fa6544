"""How strong a motion is, in one number that records of any length can be compared by."""

from typing import NamedTuple

import numpy as np

from femupdate.arrays import Floats

_STRONG = 0.05, 0.95  # of the energy, between which a motion is strong
PERIODS = 4.0  # of the strongest mode, over which the level of a moment is taken
SPAN = 1.0  # doublings to both sides of the mean level, to which laws of the level are known
PARTS = 7  # of a run, of equal energy of the base, that have a level each
# Where no histories of the run are known: motion that counts has from half to twice the usual
# amplitude, evenly.
RUN_LEVELS = tuple((2 * k + 1 - PARTS) / PARTS for k in range(PARTS))
_SILENCE = 1e-12


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


def level_of_moment(acceleration: Floats, mean: Floats, width: int) -> Floats:
    """Doublings (..., n) of motions (..., f, n) above their mean level, within the span.

    Args:
        acceleration: of f floors, m/s2.
        mean: (..., f) levels; NaN where a floor does not count.
        width: samples over which the level of a moment is taken.
    """
    from scipy.ndimage import uniform_filter1d

    squared = uniform_filter1d(acceleration**2, width, axis=-1, mode="constant")
    share = np.nanmean(squared / np.maximum(mean, _SILENCE)[..., None] ** 2, axis=-2)
    return np.clip(0.5 * np.log2(np.maximum(share, _SILENCE)), -SPAN, SPAN)


def strongest_hz(floors: Floats, time_step: float) -> float:
    """Frequency at which floors (f, n) move most."""
    from scipy.signal import welch

    # Segments of 20 s tell the strongest mode.
    length = min(floors.shape[1], round(20.0 / time_step))
    frequency, power = welch(floors, 1.0 / time_step, nperseg=length)
    return float(frequency[1 + power[:, 1:].sum(axis=0).argmax()])


class RunLevels(NamedTuple):
    """How a motion is spread about its mean level."""

    middle: float  # mean over its parts, doublings above the mean level
    parts: tuple[float, ...]  # each above that middle, lowest first


def levels_in_run(base: Floats, floors: Floats, time_step: float) -> RunLevels:
    """Levels of seven parts of a run with equal energy of the base motion.

    An estimate H1 over the run is the mean over such parts, for
    it divides the sum of their cross spectra by the sum of their power spectra.

    Args:
        base: (n,) acceleration.
        floors: (f, n).
    """
    from scipy.ndimage import uniform_filter1d

    width = max(1, round(PERIODS / strongest_hz(floors, time_step) / time_step))
    level = level_of_moment(floors, motion_level(floors), width)
    energy = uniform_filter1d(base**2, width, mode="constant")
    order = np.argsort(level)
    reached = np.cumsum(energy[order])
    middles = (np.arange(PARTS) + 0.5) / PARTS
    at = np.searchsorted(reached, middles * reached[-1])
    parts = level[order][np.minimum(at, level.size - 1)]
    middle = float(parts.mean())
    return RunLevels(middle, tuple(float(part) for part in parts - middle))
