"""Whether chains agree, draws meet the data, and what these determine, in how many modes."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import median_low

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.special import chdtrc, ndtri
from torch import Tensor

from femupdate.arrays import Floats, Integers
from femupdate.inference.importance import Mixture, fit_mixture
from femupdate.seeds import torch_generator
from femupdate.units import percent

_PLACES = 21  # points between two groups at which the density is looked at


def separate_modes(x: Tensor) -> Tensor:
    """Return the mode (n,) of every draw of x (n, p), 0 for the heaviest.

    Components of a mixture belong to one mode unless the density between them dips deeply (Hennig
    2010, Adv. Data Anal. Classif. 4, 3). Of a sheet that bends in many dimensions the Gaussians are
    separate where the draws are not: modes are told apart only where the draws dip as well.

    Args:
        x: in coordinates of comparable size, float64.
    """
    generator = torch_generator(0)
    some = x[torch.randperm(len(x), generator=generator)[:4000]]
    distinct = len(torch.unique(some[:, 0]))
    components = max(1, min(8, distinct // (10 * (x.shape[1] + 1))))
    # Of few draws one fit may join two modes.
    fits = [
        fit_mixture(some, components, generator, iterations=100)
        for _ in range(1 if len(some) > 1000 else 6)
    ]
    mixture = max(fits, key=lambda fit: float(fit.log_density(some).mean()))
    group = torch.tensor(_joined(mixture))
    return _numbered(x, _seen_apart(x, group[mixture.component_log_density(x).argmax(dim=1)]))


def _joined(mixture: Mixture) -> list[int]:
    """The group of every component."""
    count = len(mixture.mean)
    peak = mixture.log_density(mixture.mean).tolist()
    share = torch.linspace(0.0, 1.0, _PLACES, dtype=torch.float64).to(mixture.mean)
    saddles = []
    for left, other in combinations(range(count), 2):
        path = torch.lerp(mixture.mean[left], mixture.mean[other], share[:, None])
        saddles.append((float(mixture.log_density(path).min()), left, other))
    group = list(range(count))
    for saddle, left, other in sorted(saddles, reverse=True):
        a, b = group[left], group[other]
        if a != b and saddle > min(peak[a], peak[b]) + math.log(0.1):
            group = [a if g == b else g for g in group]
            peak[a] = max(peak[a], peak[b])
    return group


def _seen_apart(x: Tensor, member: Tensor) -> Tensor:
    """Groups (n,) with those joined between which the draws do not dip."""
    for left, other in combinations(torch.unique(member).tolist(), 2):
        first, second = x[member == left], x[member == other]
        if min(len(first), len(second)) > 1 and not _dips(first, second):
            return _seen_apart(x, torch.where(member == other, left, member))
    return member


def _dips(first: Tensor, second: Tensor) -> bool:
    """Whether few draws of two groups lie between them, along Fisher's linear discriminant."""
    inside = torch.atleast_2d(torch.cov(first.T) + torch.cov(second.T))
    inside = inside + 1e-9 * inside.diagonal().mean() * torch.eye(len(inside)).to(inside)
    direction = torch.linalg.solve(inside, second.mean(0) - first.mean(0))
    low, high = first @ direction, second @ direction
    width = 0.3 * min(float(low.std()), float(high.std())) + 1e-12
    ends = (float(low.mean()), float(high.mean()))
    places = torch.linspace(*ends, _PLACES, dtype=low.dtype)
    offset = (places[:, None] - torch.cat([low, high])) / width
    density = torch.exp(-0.5 * offset.square()).mean(1)
    least = int(density.argmin())
    peaks = min(density[: least + 1].max(), density[least:].max())
    return bool(density[least] < 0.5 * peaks)


def _numbered(x: Tensor, member: Tensor) -> Tensor:
    """Modes by weight, the smallest ones given to their neighbours."""
    labels, counts = torch.unique(member, return_counts=True)
    labels = labels[counts.argsort(descending=True)]
    least = min(max(0.01 * len(x), 20), int(counts.max()))
    kept = labels[: int((counts >= least).sum())]
    centre = torch.stack([x[member == label].mean(dim=0) for label in kept])
    number = torch.cdist(x, centre).argmin(dim=1)
    for place, label in enumerate(kept):
        number[member == label] = place
    return number


# Shares of the prior's standard deviation left: from which a combination counts as not determined,
# and a parameter as before.
_UNDETERMINED, _AS_BEFORE = 0.5, 0.85
# Times what is allowed for from which data are missed: floors of right models (sticks, a frame, two
# towers, 29 runs) had .20 to 1.17 and once 1.40, and never 1.6 times what the others had.
MISSED, _OVER_OTHERS = 1.2, 2.0
_MOST_TOLD, _MOST_NAMES = 3, 6  # combinations that are told, parameters in one


def r_hat(draws: ArrayLike) -> Floats | None:
    """Rank-normalised split r-hat (p,) of chains (c, n, p); None for fewer than two chains.

    The larger of the r-hat of the draws and of their distances from the median, each by ranks
    turned into normal scores and with every chain cut in two (Vehtari et al. 2021, Bayesian
    Analysis 16, 667). Only chains that ran apart may be compared: draws of one importance sample
    agree however poor they are.
    """
    # The statistics of scipy take a second to be imported.
    from scipy.stats import rankdata

    def reduction(chains: Floats) -> float:
        """Of chains (c, n), by normal scores of their ranks (Blom 1958; Gelman & Rubin 1992)."""
        rank = rankdata(chains).reshape(chains.shape)
        scores, count = ndtri((rank - 0.375) / (chains.size + 0.25)), chains.shape[1]
        within = scores.var(axis=1, ddof=1).mean()
        between = scores.mean(axis=1).var(ddof=1)
        ratio = (count - 1) / count + between / within if within > 0.0 else np.nan
        return float(np.sqrt(ratio))

    values = np.asarray(draws, dtype=float)
    if len(values) < 2:
        return None
    half = values.shape[1] // 2
    halves = np.moveaxis(np.concatenate([values[:, :half], values[:, -half:]]), -1, 0)
    return np.array([max(reduction(x), reduction(np.abs(x - np.median(x)))) for x in halves])


@dataclass(frozen=True)
class PredictiveCheck:
    """Posterior predictive p-values.

    Attributes:
        floors: of each floor alone; NaN where it has no valid point.
        ratios: of the squares to those of replicates, in the mean of the draws: of all, then of
            each floor. A thousand points make a p-value small where one is hardly above one.
    """

    whole: float
    floors: tuple[float, ...]
    names: tuple[str, ...]
    ratios: tuple[float, ...] = (1.0,)

    @property
    def missed(self) -> tuple[str, ...]:
        """Floors that miss the model by more than is allowed for, and far more than others do."""
        over = [ratio**0.5 for ratio in self.ratios[1:]]
        least = max(MISSED, _OVER_OTHERS * median_low(over)) if over else MISSED
        each = zip(self.names, self.floors, over, strict=False)
        return tuple(name for name, tail, ratio in each if tail < 0.01 and ratio > least)

    def sentence(self) -> str:
        """For the user."""
        floors = ", ".join(
            f"{name} {value:.2g}" for name, value in zip(self.names, self.floors, strict=True)
        )
        return (
            f"Posterior predictive p-value {self.whole:.2g} ({floors}): the data miss the model "
            f"by {self.ratios[0] ** 0.5:.2f} times what is allowed for"
        )

    def as_dict(self) -> dict[str, object]:
        """Plain numbers for JSON."""
        whole, *each = (ratio**0.5 for ratio in self.ratios)
        floors = dict(zip(self.names, self.floors, strict=True))
        over = {"over_allowed": whole, "floors_over": dict(zip(self.names, each, strict=False))}
        return {"whole": self.whole, "floors": floors, **over}


def predictive_check(
    squares: ArrayLike, freedom: ArrayLike, names: tuple[str, ...]
) -> PredictiveCheck:
    """p-values of the squares that posterior draws leave.

    Args:
        squares: (n, f) sum of squared whitened residuals of every floor at every draw, counted so
            that each independent point has the expectation of one.
        freedom: (f,) independent points of every floor, or (n, f) where draws differ in them.
    """
    left = np.asarray(squares, dtype=float)
    points = np.broadcast_to(np.asarray(freedom, dtype=float), left.shape)
    seen = points > 0.0
    tails = chdtrc(np.where(seen, points, 1.0), left).mean(axis=0)
    floors = np.where(seen.all(axis=0), tails, np.nan)
    whole = chdtrc(points.sum(axis=1), left.sum(axis=1)).mean()
    both = (np.column_stack([values.sum(axis=1), values]) for values in (left, points))
    ratios = (next(both) / next(both).clip(min=1.0)).mean(axis=0)
    return PredictiveCheck(float(whole), tuple(floors.tolist()), names, tuple(ratios.tolist()))


@dataclass(frozen=True)
class Combination:
    """A direction in the logarithms of the parameters.

    Attributes:
        weight: (p,) of unit length, largest positive: change of each ln theta in units of its
            prior standard deviation.
        kept: posterior over prior standard deviation along it.
    """

    weight: Floats
    kept: float


@dataclass(frozen=True)
class PosteriorMode:
    """One of several separate modes.

    Attributes:
        weight: share of the draws.
        mean: (p,).
        sd: (p,).
    """

    weight: float
    mean: Floats
    sd: Floats


@dataclass(frozen=True)
class Identifiability:
    """What data have told about parameters.

    Attributes:
        combinations: all p of them, from the least determined on; inside the modes where there
            are several.
        left_alone: parameters that no determined combination holds a part of.
        among_others: combinations of the other parameters alone, from the least determined on.
        modes: heaviest first; one where the draws are of one piece.
    """

    names: tuple[str, ...]
    combinations: tuple[Combination, ...]
    left_alone: tuple[str, ...]
    among_others: tuple[Combination, ...]
    modes: tuple[PosteriorMode, ...]

    @property
    def undetermined(self) -> int:
        """How many combinations have kept more than half of their prior standard deviation."""
        return sum(part.kept > _UNDETERMINED for part in self.combinations)

    def sentences(self) -> Iterator[str]:
        """What an engineer should know; nothing where all is determined."""
        if len(self.modes) > 1:
            # All parameters of a few, else those that differ most between the modes.
            shown = list(range(len(self.names)))
            if len(shown) > 10:
                means = np.stack([mode.mean for mode in self.modes])
                inside = np.mean([mode.sd for mode in self.modes], axis=0)
                apart = np.ptp(means, axis=0) / np.maximum(inside, 1e-300)
                shown = sorted(np.argsort(-apart)[:_MOST_NAMES].tolist())
            listed = "; ".join(
                f"{percent(mode.weight)} near "
                + ", ".join(f"{self.names[k]} {mode.mean[k]:.3g}" for k in shown)
                for mode in self.modes[:_MOST_NAMES]
            )
            if len(shown) < len(self.names):
                listed += " (the others differ less)"
            yield (
                f"The posterior has {len(self.modes)} separate modes, between which the data cannot"
                f" decide: {listed}. Means and standard deviations over all of them describe none;"
                " those of each are in the summary."
            )
        kept = {name: self.kept(name) for name in self.left_alone}
        nothing = ", ".join(name for name, share in kept.items() if share >= _AS_BEFORE)
        some = {name: share for name, share in kept.items() if share < _AS_BEFORE}
        little = ", ".join(f"{name} ({percent(share)})" for name, share in some.items())
        if nothing:
            yield f"The data say next to nothing about {nothing}: the posterior there is the prior."
        if little:
            yield (
                f"The data say little about {little}: so much of the prior's standard deviation is"
                " left."
            )
        loose = [part for part in self.among_others if part.kept > _UNDETERMINED]
        if loose:
            listed = "; ".join(
                f"{self.describe(part)} ({percent(part.kept)} of the prior's standard deviation"
                " left)"
                for part in loose[:_MOST_TOLD]
            )
            more = f"; and {len(loose) - _MOST_TOLD} more" if len(loose) > _MOST_TOLD else ""
            yield f"The data hardly determine {listed}{more}."

    def kept(self, name: str) -> float:
        """Posterior over prior standard deviation of one parameter, inside the modes."""
        place = self.names.index(name)
        return (
            sum((part.kept * float(part.weight[place])) ** 2 for part in self.combinations) ** 0.5
        )

    def describe(self, part: Combination) -> str:
        """Words for a combination, such as "theta_4 up with theta_5 down"."""
        order = np.argsort(-np.abs(part.weight))
        named = [k for k in order if abs(part.weight[k]) >= 0.35 * abs(part.weight[order[0]])]
        shown = named[:_MOST_NAMES]
        up, down = (
            " and ".join(self.names[k] for k in shown if sign * part.weight[k] > 0)
            for sign in (1.0, -1.0)
        )
        rest = ", among others" if len(named) > len(shown) else ""
        if len(shown) == 1:
            return f"{up} by itself"
        return f"{up} up with {down} down{rest}" if down else f"{up} up together{rest}"


def identifiability(
    theta: ArrayLike, lower: ArrayLike, upper: ArrayLike, names: Sequence[str]
) -> Identifiability:
    """Compare posterior draws theta (n, p) with their uniform prior on [lower, upper] (p,).

    Parameters with a positive lower bound are compared in their logarithm (a change by a factor),
    others as they are. Separate modes are told apart first, and combinations are those inside the
    modes, mean over their weights.
    """
    draws = np.asarray(theta, dtype=float)
    white = _whitened(draws, np.asarray(lower, dtype=float), np.asarray(upper, dtype=float))
    member = separate_modes(torch.from_numpy(white)).numpy()
    groups = [np.flatnonzero(member == k) for k in range(member.max() + 1)]
    share = [len(rows) / len(draws) for rows in groups]
    inside = [np.atleast_2d(np.cov(white[rows].T)) for rows in groups]
    covariance = np.sum([w * c for w, c in zip(share, inside, strict=True)], axis=0)
    combinations = _combinations(covariance, np.arange(len(covariance)))
    # Parameters that lie outside of all determined combinations.
    determined = [part.weight**2 for part in combinations if part.kept <= _UNDETERMINED]
    alone = np.sum(determined or [np.zeros(len(combinations))], axis=0) < 0.1
    return Identifiability(
        tuple(names),
        combinations,
        tuple(name for name, left in zip(names, alone, strict=True) if left),
        _combinations(covariance, np.flatnonzero(~alone)),
        tuple(
            PosteriorMode(w, draws[rows].mean(axis=0), draws[rows].std(axis=0, ddof=1))
            for w, rows in zip(share, groups, strict=True)
        ),
    )


def _whitened(draws: Floats, lower: Floats, upper: Floats) -> Floats:
    """Draws in coordinates in which each parameter's prior has mean zero and variance one."""
    columns = []
    for values, low, high in zip(draws.T, lower, upper, strict=True):
        if low > 0.0:
            # Moments of ln u, u uniform on the range, by the antiderivatives.
            ends = np.array([low, high])
            log = np.log(ends)
            mean = np.diff(ends * (log - 1.0))[0] / (high - low)
            square = np.diff(ends * (log**2 - 2.0 * log + 2.0))[0] / (high - low)
            columns.append((np.log(values) - mean) / np.sqrt(square - mean**2))
        else:
            columns.append((values - 0.5 * (low + high)) / ((high - low) / 12**0.5))
    return np.column_stack(columns)


def _combinations(covariance: Floats, chosen: Integers) -> tuple[Combination, ...]:
    """Eigenvectors of the chosen parameters' covariance, as directions of all parameters."""
    value, vector = np.linalg.eigh(covariance[np.ix_(chosen, chosen)])
    found = []
    for variance, part in zip(value[::-1], vector.T[::-1], strict=True):
        weight = np.zeros(len(covariance))
        weight[chosen] = part * np.sign(part[np.abs(part).argmax()])
        found.append(Combination(weight, float(np.sqrt(max(variance, 0.0)))))
    return tuple(found)
