"""How far two sets of draws are apart: MMD, classifier test, mode weights, widths."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from femupdate.arrays import Floats, Integers
from femupdate.errors import InferenceError

_ROWS = 1000  # of a kernel matrix at a time
_MEDIAN_DRAWS = 2000


def median_distance(draws: ArrayLike, seed: int = 0) -> float:
    """Median Euclidean distance between pairs of draws (n, p), of at most 2,000 of them."""
    points = np.asarray(draws, dtype=float)
    if len(points) > _MEDIAN_DRAWS:
        rows = np.random.default_rng(seed).choice(len(points), _MEDIAN_DRAWS, replace=False)
        points = points[rows]
    return float(torch.pdist(torch.from_numpy(points)).median())


def mean_kernel(x: Tensor, y: Tensor, bandwidth: float) -> float:
    """Mean of exp(-|x_i - y_j|^2 / (2 bandwidth^2)) over all pairs, in strips of rows."""
    total = 0.0
    scaled_y = (y / bandwidth).float()
    for rows in (x / bandwidth).float().split(_ROWS):
        squared = torch.cdist(rows, scaled_y, compute_mode="donot_use_mm_for_euclid_dist").square_()
        total += float(squared.mul_(-0.5).exp_().sum(dtype=torch.float64))
    return total / (len(x) * len(y))


class MmdReference:
    """Draws that others are compared with by maximum mean discrepancy.

    The unsquared biased estimate of Gretton et al. (2012, J. Mach. Learn. Res. 13, 723, eq. 5),
    sqrt(mean k(x, x') - 2 mean k(x, y) + mean k(y, y')), diagonals included, with a Gaussian kernel
    whose bandwidth is the median distance between the reference's own draws.

    Args:
        draws: (m, p).
        bandwidth: default the median heuristic.
    """

    def __init__(self, draws: ArrayLike, bandwidth: float | None = None) -> None:
        points = np.asarray(draws, dtype=float)
        self.bandwidth = bandwidth or median_distance(points)
        self._draws = torch.from_numpy(points)
        self._own = mean_kernel(self._draws, self._draws, self.bandwidth)

    def __call__(self, draws: ArrayLike) -> float:
        """MMD of draws (n, p) from the reference."""
        x = torch.from_numpy(np.asarray(draws, dtype=float))
        own, cross = (mean_kernel(x, y, self.bandwidth) for y in (x, self._draws))
        return float(np.sqrt(max(0.0, own - 2.0 * cross + self._own)))


def classifier_accuracy(x: ArrayLike, y: ArrayLike, seed: int = 0, folds: int = 5) -> float:
    """C2ST: cross-validated accuracy of telling x (n, p) from y (m, p); .5 where they are equal.

    A network of two hidden layers of 10 p units on standardised coordinates (Lopez-Paz & Oquab
    2017; sizes of Lueckmann et al. 2021, AISTATS). The larger set is thinned to the smaller.
    """
    try:
        from sklearn.model_selection import StratifiedKFold, cross_val_score
        from sklearn.neural_network import MLPClassifier
    except ImportError as error:
        raise InferenceError(
            'the classifier test needs scikit-learn; pip install "femupdate[benchmark]"'
        ) from error
    rng = np.random.default_rng(seed)
    sets = [np.asarray(part, dtype=float) for part in (x, y)]
    count = min(len(part) for part in sets)
    one, other = (part[rng.permutation(len(part))[:count]] for part in sets)
    scale = one.std(axis=0)
    features = (np.concatenate([one, other]) - one.mean(axis=0)) / np.where(scale > 0, scale, 1.0)
    # A draw far out must not drown the others.
    features = np.clip(features, -10.0, 10.0)
    width = 10 * features.shape[1]
    network = MLPClassifier(
        (width, width), max_iter=300, early_stopping=True, n_iter_no_change=15, random_state=seed
    )
    splits = StratifiedKFold(folds, shuffle=True, random_state=seed)
    labels = np.repeat([0, 1], count)
    return float(cross_val_score(network, features, labels, cv=splits).mean())


@dataclass(frozen=True)
class ModeSummary:
    """Draws shared out among known solutions."""

    member: Integers  # (n,) index of each draw's solution
    weight: Floats  # (m,) share of the draws
    mean: Floats  # (m, p); NaN for a solution without draws
    sd: Floats  # (m, p); NaN for a solution with fewer than two


def mode_summary(draws: ArrayLike, solutions: ArrayLike, scale: ArrayLike) -> ModeSummary:
    """Share draws (n, p) out to the nearest of the solutions (m, p)."""
    points, centres = np.asarray(draws, dtype=float), np.asarray(solutions, dtype=float)
    distance = (((points[:, None] - centres) / np.asarray(scale)) ** 2).sum(axis=-1)
    member = distance.argmin(axis=1)
    count = len(centres)
    mean, sd = np.full(centres.shape, np.nan), np.full(centres.shape, np.nan)
    for k in range(count):
        own = points[member == k]
        if len(own):
            mean[k] = own.mean(axis=0)
        if len(own) > 1:
            sd[k] = own.std(axis=0, ddof=1)
    return ModeSummary(member, np.bincount(member, minlength=count) / len(points), mean, sd)


def total_variation(weight: ArrayLike, other: ArrayLike) -> float:
    """Half the sum of absolute differences of two sets of weights."""
    return float(0.5 * np.abs(np.asarray(weight) - np.asarray(other)).sum())


def local_coordinates(
    draws: ArrayLike, solutions: ArrayLike, mean: ArrayLike, sd: ArrayLike
) -> Floats:
    """Coordinates in which a narrow posterior with several modes can be judged, (n, p + m).

    Offset from the mean of the nearest mode in its standard deviations, and which mode it is: a
    classifier on the plain coordinates sees the modes only, a thousandth of its range wide.
    """
    summary = mode_summary(draws, solutions, sd)
    offset = (np.asarray(draws) - np.asarray(mean)[summary.member]) / np.asarray(sd)[summary.member]
    return np.hstack([offset, np.eye(len(summary.weight))[summary.member]])
