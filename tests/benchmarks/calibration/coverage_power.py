"""One scalar of last calibration: the power of a likelihood at which regions cover as they say."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats

from .coverage import density_level

_POWERS = np.geomspace(0.25, 4.0, 97)
_BOOTSTRAPS = 200


@dataclass(frozen=True)
class SimulatedCase:
    """Posterior draws for one simulation under a flat prior, with its truth."""

    log_likelihood: Floats  # (n,) of equally weighted draws
    log_likelihood_of_truth: float  # at the parameters that made the data


@dataclass(frozen=True)
class PowerFit:
    """The power that calibrates, and how well it is known."""

    power: float  # of the likelihood
    error: float  # standard deviation over resampled cases
    level: Floats  # (c,) credibility levels of the truths at that power


def levels_at_power(cases: Sequence[SimulatedCase], power: float) -> Floats:
    """Levels (c,) of the highest-density regions that hold the truths, likelihood to a power.

    Draws made at power one are weighted by the likelihood to the power less one; the order of
    densities stays the same.
    """
    return np.array([_level(case, power) for case in cases])


def fit_power(cases: Sequence[SimulatedCase], seed: int = 0) -> PowerFit:
    """Choose the power whose levels are nearest to uniform, by the Cramer-von Mises distance.

    Expected coverage of highest-density regions is as it should be where the levels are uniform
    (Hermans et al. 2022, Trans. Mach. Learn. Res.).
    """
    table = np.stack([levels_at_power(cases, power) for power in _POWERS])  # (powers, cases)
    best = _best(table)
    rng = np.random.default_rng(seed)
    count = table.shape[1]
    again = [_best(table[:, rng.integers(count, size=count)]) for _ in range(_BOOTSTRAPS)]
    return PowerFit(float(_POWERS[best]), float(np.std(_POWERS[again])), table[best])


def _level(case: SimulatedCase, power: float) -> float:
    values = np.asarray(case.log_likelihood, dtype=float)
    weight = np.exp((power - 1.0) * (values - values.max()))
    return density_level(values, case.log_likelihood_of_truth, weight)


def _best(table: ArrayLike) -> int:
    """Index of the row of levels nearest to uniform."""
    ordered = np.sort(np.asarray(table, dtype=float), axis=1)
    count = ordered.shape[1]
    uniform = (np.arange(count) + 0.5) / count
    return int(((ordered - uniform) ** 2).sum(axis=1).argmin())
