"""How far two sets of draws are apart: classifier test, mode weights, widths."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats, Integers
from femupdate.errors import InferenceError


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
