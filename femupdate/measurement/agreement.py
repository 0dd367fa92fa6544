"""Whether several runs of a building agree, without any model."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import chdtrc

from femupdate.measurement.observation import (
    Observation,
    band_edges,
    independent_share,
    on_all_floors,
)
from femupdate.measurement.pooled import pooled
from femupdate.measurement.thresholds import AGREEMENT


@dataclass(frozen=True)
class Difference:
    """Difference of one run from the others together, at one floor in one band.

    Attributes:
        source: the run.
        others: those that it is compared with.
        floor: its name.
        band_hz: the band.
        mean: of the difference in ln|H|, run less others, weighted by precision.
        ratio: rms of the difference over the noise of both.
        independent: points that err independently.
        p_value: probability that noise alone makes it as large.
    """

    source: str
    others: str
    floor: str
    band_hz: tuple[float, float]
    mean: float
    ratio: float
    independent: float
    p_value: float


@dataclass(frozen=True)
class Agreement:
    """How well some runs agree.

    Attributes:
        ratio: rms of all differences over their noise; NaN where no floor is common.
        differences: every run against the others, floor by floor and band by band.
    """

    ratio: float
    differences: tuple[Difference, ...]

    @property
    def beyond_chance(self) -> tuple[Difference, ...]:
        """Differences that noise does not explain, the least likely first."""
        limit = AGREEMENT.chance / max(len(self.differences), 1)
        found = [d for d in self.differences if d.p_value < limit and d.ratio > AGREEMENT.ratio]
        return tuple(sorted(found, key=lambda one: (one.p_value, -one.ratio)))

    def sentence(self) -> str:
        """The agreement in a sentence for the user."""
        if np.isnan(self.ratio):
            return (
                "No floor was measured in more than one of them: whether they agree cannot be told "
                "without a model."
            )
        found = self.beyond_chance
        if not found:
            return f"They agree: their differences are {self.ratio:.2f} times the noise (rms)."
        first = found[0]
        others = "" if len(found) == 1 else f", and so in {len(found) - 1} more places"
        return (
            f"They do not agree: {first.source} differs from {first.others} at {first.floor}, "
            f"{first.band_hz[0]:.3g} to {first.band_hz[1]:.3g} Hz, by {first.ratio:.1f} times the "
            f"noise of both (rms; {100.0 * np.expm1(first.mean):+.0f} % on average){others}. The "
            "posterior is that of their mean; calibrate each alone to see how they differ. Was the "
            "motion stronger in one "
            "(`femupdate diagnose ONE --second OTHER`), a sensor moved, the building changed?"
        )


def agreement(runs: Sequence[Observation], floors: Sequence[str]) -> Agreement:
    """Compare every run with all others, pooled, by the chi-square of their differences.

    Of two runs, the second is compared with the first.

    Args:
        runs: on one frequency grid.
        floors: of the building, bottom to top.
    """
    found: list[Difference] = []
    compared = range(1, 2) if len(runs) == 2 else range(len(runs))
    for number in compared:
        others = [run for k, run in enumerate(runs) if k != number]
        found.extend(_differences(runs[number], pooled(others, floors), floors))
    total = sum(d.independent for d in found)
    squares = sum(d.independent * d.ratio**2 for d in found)
    return Agreement(float(np.sqrt(squares / total)) if total else float("nan"), tuple(found))


def _differences(run: Observation, others: Observation, floors: Sequence[str]) -> list[Difference]:
    share = min(independent_share(run), independent_share(others))
    one, rest = (on_all_floors(each, floors) for each in (run, others))
    both = one.valid & rest.valid
    difference = np.where(both, one.log_frf - rest.log_frf, 0.0)
    variance = np.where(both, one.noise_sd**2 + rest.noise_sd**2, np.inf)
    found: list[Difference] = []
    for low, high in pairwise(band_edges(run.frequency_hz)):
        inside = (run.frequency_hz >= low) & (run.frequency_hz < high)
        for row, floor in enumerate(floors):
            seen = both[row] & inside
            independent = share * float(np.count_nonzero(seen))
            if independent < AGREEMENT.fewest:
                continue
            weight = 1.0 / variance[row, seen]
            square = float((weight * difference[row, seen] ** 2).mean())
            found.append(
                Difference(
                    run.source,
                    others.source,
                    floor,
                    (float(low), float(high)),
                    float((weight * difference[row, seen]).sum() / weight.sum()),
                    square**0.5,
                    independent,
                    float(chdtrc(independent, independent * square)),
                )
            )
    return found
