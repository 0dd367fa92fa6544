"""Which stiffness factors changed between two posteriors of one building.

With flat priors, two independent normal posteriors of ln theta say of the change delta that the
difference d of their means is normal about delta, with the sum S of their covariances. Each factor
has changed or not; a change is normal about zero with the deviation `SCALE` (spike and slab,
George and McCulloch 1993, JASA 88, 881). The evidence of every set of changed factors is then
known in closed form, and so is the probability of each. One more hypothesis is a change of all
factors alike, as temperature, level of motion or a wrong mass bring about.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from femupdate.arrays import Floats

SCALE = 0.2  # prior standard deviation of a change in ln: damage of a tenth to a third
NONE = 0.5  # probability that nothing changed, before the data
NAMED = 0.95  # probability from which a factor counts as changed


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What changed, by p factors.

    Attributes:
        alike: probability that all factors changed alike; of a single factor, that it changed.
        probability: (p,) that a factor changed, alone or with others.
        size: (p,) mean of ln(after / before) where it changed.
        size_sd: (p,) its standard deviation.
        visible: (p,) smallest |ln(after / before)| of one factor alone that would be named.
    """

    none: float
    alike: float
    probability: Floats
    size: Floats
    size_sd: Floats
    visible: Floats


def changes(before: Floats, after: Floats) -> Changes:
    """Probabilities that factors changed.

    Args:
        before, after: (n, p) and (m, p) draws of ln theta of two posteriors, from data that share
            no noise.
    """
    shift = after.mean(axis=0) - before.mean(axis=0)
    covariance = np.atleast_2d(np.cov(before.T)) + np.atleast_2d(np.cov(after.T))
    precision = np.asarray(np.linalg.inv(covariance), float)
    designs, log_priors = zip(*_hypotheses(len(shift)), strict=True)
    fits = [_fit(design, precision, shift) for design in designs]
    log_weight = np.array(log_priors) + [fit[0] for fit in fits]
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    involved = np.array([(design != 0.0).any(axis=1) for design in designs])
    share = weight[:, None] * involved
    probability = share.sum(axis=0)
    inside = share / np.maximum(probability, 1e-300)
    means, variances = (np.array([fit[k] for fit in fits]) for k in (1, 2))
    size = (inside * means).sum(axis=0)
    square = (inside * (variances + means**2)).sum(axis=0) - size**2
    # Smallest changes that are named, where no other factor changes.
    information, single = precision.diagonal(), _single(len(shift))
    needed = math.log(NAMED / (1.0 - NAMED)) + math.log((1.0 - single) / single)
    square_needed = (2.0 * needed + np.log1p(SCALE**2 * information)) * (
        information + 1.0 / SCALE**2
    )
    return Changes(
        none=float(weight[0]),
        alike=float(weight[-1]),
        probability=probability,
        size=size,
        size_sd=np.sqrt(square.clip(0.0)),
        visible=np.sqrt(square_needed.clip(0.0)) / information,
    )


def _single(count: int) -> float:
    """Prior probability of a change of one of `count` factors."""
    return 1.0 - NONE ** (1.0 / count)


def _hypotheses(count: int) -> Iterator[tuple[Floats, float]]:
    """Columns (p, k) of changes and their log priors: nothing, sets of factors, all alike."""
    single = _single(count)
    most = count if count <= 10 else 3
    for size in range(most + 1):
        prior = size * math.log(single) + (count - size) * math.log1p(-single)
        for chosen in combinations(range(count), size):
            yield np.eye(count)[:, list(chosen)], prior
    if count > 1:
        yield np.ones((count, 1)), math.log(single) + (count - 1) * math.log1p(-single)


def _fit(design: Floats, precision: Floats, shift: Floats) -> tuple[float, Floats, Floats]:
    """Log evidence over that of no change; mean and variance (p,) of the change."""
    inner = design.T @ precision @ design
    pull = design.T @ precision @ shift
    inverse = np.linalg.inv(inner + np.eye(design.shape[1]) / SCALE**2)
    determinant = np.linalg.slogdet(np.eye(design.shape[1]) + SCALE**2 * inner)[1]
    evidence = 0.5 * float(pull @ inverse @ pull - determinant)
    spread = np.einsum("pk,kl,pl->p", design, inverse, design)
    return evidence, design @ (inverse @ pull), spread
