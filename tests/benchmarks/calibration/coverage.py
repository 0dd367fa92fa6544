"""Whether posteriors hold the truth as often as they say: ranks, regions, TARP."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2, kstest

from femupdate.arrays import Floats

REGIONS = (0.5, 0.68, 0.9, 0.95)


@dataclass(frozen=True)
class Coverage:
    """How often regions of nominal probability held the truth."""

    nominal: Floats  # (k,) probabilities of the regions
    found: Floats  # (k,) shares of the cases
    error: Floats  # (k,) binomial standard deviation of a share that is as it should be
    cases: int  # how many


def coverage(level: ArrayLike, nominal: Sequence[float] = REGIONS) -> Coverage:
    """Share of cases whose credibility level (n,) is at most each nominal probability.

    The level of a case is the posterior probability of the smallest region of its kind that holds
    the truth; it is uniform where posteriors are right.
    """
    levels, regions = np.asarray(level, dtype=float), np.asarray(nominal, dtype=float)
    found = (levels[:, None] <= regions).mean(axis=0)
    error = np.sqrt(regions * (1.0 - regions) / len(levels))
    return Coverage(regions, found, error, len(levels))


def density_level(log_density: ArrayLike, log_density_of_truth: float) -> float:
    """Credibility level of the highest-density region that just holds the truth."""
    return float((np.asarray(log_density) > log_density_of_truth).mean())


def ranks(draws: ArrayLike, truth: ArrayLike) -> Floats:
    """Share of draws (n, p) below the truth (p,), for each parameter (p,).

    Uniform over simulated cases where posteriors are right (simulation-based calibration, Talts et
    al. 2018). Ties, which repeated draws make, count half.
    """
    points, true = np.asarray(draws, dtype=float), np.asarray(truth, dtype=float)
    return np.asarray((points < true).mean(axis=0) + 0.5 * (points == true).mean(axis=0))


def central_level(rank: ArrayLike) -> Floats:
    """Credibility level of the central interval that just holds the truth, from its rank."""
    return np.asarray(np.abs(2.0 * np.asarray(rank, dtype=float) - 1.0))


def tarp_level(draws: ArrayLike, truth: ArrayLike, reference: ArrayLike) -> float:
    """Share of draws (n, p) nearer to a random point (p,) than the truth (p,) is.

    Uniform over simulated cases where posteriors are right (tests of accuracy with random points,
    Lemos et al. 2023, ICML). The reference must not depend on the truth; coordinates should be of
    one scale.
    """
    points, centre = np.asarray(draws, dtype=float), np.asarray(reference, dtype=float)
    distance = ((points - centre) ** 2).sum(axis=-1)
    return float((distance < ((np.asarray(truth, dtype=float) - centre) ** 2).sum()).mean())


def uniformity_p_value(level: ArrayLike) -> float:
    """Kolmogorov-Smirnov p-value of levels (n,) against the uniform distribution."""
    return float(kstest(np.asarray(level, dtype=float), "uniform").pvalue)


def rank_histogram_p_value(rank: ArrayLike, bins: int = 20) -> float:
    """Chi-square p-value of a histogram of ranks (n,) against a flat one."""
    values = np.asarray(rank, dtype=float)
    seen, _ = np.histogram(values, bins=bins, range=(0.0, 1.0))
    expected = len(values) / bins
    return float(chi2.sf(((seen - expected) ** 2).sum() / expected, bins - 1))
