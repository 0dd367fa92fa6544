"""Draws against the exact posterior of a case."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats

from .case import Case, ExactPosterior, case_modes
from .metrics import classifier_accuracy, local_coordinates, total_variation

# A mode with a smaller share of the exact posterior holds too few draws to judge its width.
_LEAST_WEIGHT = 0.05


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """How draws differ from the exact posterior."""

    weight: Floats  # (m,) share of each mode
    # (m, p) standard deviation inside each mode over the exact one; NaN for modes that hold less
    # than a twentieth of the exact posterior
    sd_ratio: Floats
    mean_shift: Floats  # (m, p) of each mode's mean, in exact standard deviations; NaN likewise
    weight_distance: float  # total variation of the mode weights
    c2st: float  # accuracy of a classifier in coordinates local to the modes


def compare(case: Case, exact: ExactPosterior, theta: Floats, seed: int = 0) -> Comparison:
    """Judge draws (n, p) of a case; the seed is that of the classifier."""
    found, true = case_modes(case, theta), exact.modes
    known = (true.weight >= _LEAST_WEIGHT)[:, None]
    safe_sd = np.where(np.isfinite(true.sd), true.sd, case.sd)
    safe_mean = np.where(np.isfinite(true.mean), true.mean, case.solutions)
    rows = np.random.default_rng(seed).permutation(len(exact.theta))[: len(theta)]
    one, other = (
        local_coordinates(draws, case.solutions, safe_mean, safe_sd)
        for draws in (exact.theta[rows], theta)
    )
    return Comparison(
        weight=found.weight,
        sd_ratio=np.where(known, found.sd / true.sd, np.nan),
        mean_shift=np.where(known, (found.mean - true.mean) / true.sd, np.nan),
        weight_distance=total_variation(found.weight, true.weight),
        c2st=classifier_accuracy(one, other, seed=seed),
    )
