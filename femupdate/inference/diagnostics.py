"""Whether chains that ran apart agree: rank-normalised split r-hat."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from femupdate.arrays import Floats


def r_hat(draws: ArrayLike) -> Floats | None:
    """Rank-normalised split r-hat (p,) of chains (c, n, p); None for fewer than two chains.

    The larger of the r-hat of the draws and of their distances from the median, each by ranks
    turned into normal scores and with every chain cut in two (Vehtari et al. 2021, Bayesian
    Analysis 16, 667). Only chains that ran apart may be compared: draws of one importance sample
    agree however poor they are.
    """
    values = np.asarray(draws, dtype=float)
    if len(values) < 2:
        return None
    columns = np.moveaxis(values, -1, 0)
    return np.array(
        [max(_plain(_scores(x)), _plain(_scores(_folded(x)))) for x in map(_cut, columns)]
    )


def _cut(chains: Floats) -> Floats:
    """Both halves of every chain (c, n) as chains of their own."""
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


def _folded(chains: Floats) -> Floats:
    return np.abs(chains - np.median(chains))


def _scores(chains: Floats) -> Floats:
    """Normal scores of the ranks over all chains (Blom 1958)."""
    # The statistics of scipy take a second to be imported.
    from scipy.stats import rankdata

    rank = rankdata(chains).reshape(chains.shape)
    return np.asarray(ndtri((rank - 0.375) / (chains.size + 0.25)))


def _plain(chains: Floats) -> float:
    """Potential scale reduction of chains (c, n) (Gelman & Rubin 1992)."""
    draws = chains.shape[1]
    within = chains.var(axis=1, ddof=1).mean()
    between = chains.mean(axis=1).var(ddof=1)
    return float(np.sqrt((draws - 1) / draws + between / within)) if within > 0.0 else float("nan")
