"""Names that hold on data to which they were not fitted.

The data are parted in two halves that err independently. The parameters of an effect are fitted to
one; on the other, stiffness and damping are fitted anew with the effect held and without it, each
with what it may err by. Where they act linearly and the noise is normal, the ratio of the densities
there has an expectation of one if the effect is missing, so it is an e-value (Vovk and Wang 2021,
Ann. Stat. 49, 1736; split likelihood ratios: Wasserman, Ramdas and Balakrishnan 2020, PNAS 117,
16880); near the likeliest parameters that is nearly so. The mean over both orders of the halves is
one too. The rule of Benjamini and Hochberg for e-values holds the rate of false discoveries,
whatever the dependence (Wang and Ramdas 2022, J. R. Stat. Soc. B 84, 822).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, about, fit, log_posterior, settle
from femupdate.discrepancy.thresholds import FIT
from femupdate.inference.event_scatter import DEFAULT
from femupdate.inference.likelihood import Likelihood


@dataclass(frozen=True)
class Tested:
    """An effect on data to which it was not fitted.

    Attributes:
        label: of the effect.
        gains: log density gained on the second half by what the first half says, and the reverse.
        certified: whether the effect holds there.
    """

    label: str
    gains: tuple[float, ...]
    certified: bool

    @property
    def log_e_value(self) -> float:
        """Of the mean of both e-values."""
        return float(np.logaddexp.reduce(self.gains) - np.log(len(self.gains)))


def certify(
    problem: Likelihood, base: Fit, fits: Sequence[Fit], tried: int, false_share: float
) -> dict[str, Tested]:
    """Test fitted effects half against half, by label; none where the data cannot be parted.

    Args:
        problem: the likelihood of the data.
        base: the model without the effects, fitted to all data.
        fits: with one effect more each.
        tried: number of effects from which these were chosen.
        false_share: of false discoveries that is allowed.
    """
    if not problem.divisible:
        return {}
    halves = [_Half.of(problem, base, number) for number in (0, 1)]
    found = {}
    for one in fits:
        gains = tuple(halves[1 - number].gain(one, halves[number].values(one)) for number in (0, 1))
        found[one.placed[-1].label] = Tested(one.placed[-1].label, gains, False)
    values = sorted((one.log_e_value for one in found.values()), reverse=True)
    least = least_log_e_value(values, tried, false_share)
    return {
        label: Tested(label, one.gains, one.log_e_value >= least) for label, one in found.items()
    }


def missed_in_turn(fitted: Fit) -> float:
    """Mean squared residual, by the noise alone, of each half of the data by a fit to the other.

    NaN where the data cannot be parted. Unlike in `certify`, stiffness and damping too are those of
    the other half.
    """
    problem = fitted.likelihood
    if not problem.divisible:
        return float("nan")
    halves = [_Half.of(problem, fitted, number) for number in (0, 1)]
    pairs = ((halves[1].problem, halves[0].base), (halves[0].problem, halves[1].base))
    return float(np.mean([mean_square(other, own) for other, own in pairs]))


def mean_square(problem: Likelihood, fitted: Fit) -> float:
    """Mean squared residual of other data, by the noise alone, at the parameters of a fit."""
    error = problem.error
    residual = error.tame(problem.of(fitted.likelihood).raw(fitted.parameters), error.first)
    return float((residual**2).sum()) / max(problem.effective, 1.0)


def gain_elsewhere(elsewhere: Likelihood, before: Fit, after: Fit) -> float:
    """Log density of another event's data by a fit with one effect more over that without it.

    Each predicts that event by its own posterior and what events differ by.

    Args:
        elsewhere: the other data, for the structure of the fits.
        before, after: without and with the effect.
    """
    known = after.likelihood
    alike = [one.name for one in elsewhere.data] == [one.name for one in known.data]
    kept = (
        replace(elsewhere, error=elsewhere.error.with_rows_of(known.error)) if alike else elsewhere
    )
    own = about(kept, before)
    row = before.likelihood.row if alike else own.error.start
    without = settle(own, as_event(own.at_row(row), before))
    row = after.likelihood.row if alike else without.likelihood.row
    with_it = settle(own, as_event(own.at_row(row), after))
    return _log_predictive(own, with_it) - _log_predictive(own, without)


def as_event(elsewhere: Likelihood, fitted: Fit) -> Fit:
    """Another event by a fit's model: its own posterior and the scatter of events are the prior."""
    where, covariance = fitted.steps, fitted.within_limits()
    covariance[: where.stories, : where.stories] += float(DEFAULT.stiffness) ** 2
    if where.has_zeta:
        covariance[where.stories, where.stories] += float(DEFAULT.damping) ** 2
    prior = where.about(fitted.z, covariance)
    own = elsewhere.of(fitted.likelihood)
    return fit(own, fitted.placed, fitted.z, FIT.steps, prior)


def _log_predictive(problem: Likelihood, event: Fit) -> float:
    """Log density of the data by the prior of an event, in Laplace's approximation."""
    gained = torch.linalg.slogdet(event.hessian()).logabsdet
    known = torch.linalg.slogdet(event.steps.precision).logabsdet
    return log_posterior(problem, event) - 0.5 * float(gained - known)


def least_log_e_value(values: list[float], tried: int, false_share: float) -> float:
    """Log e-value from which effects are discoveries: the k-th is at least tried / (k share).

    Args:
        values: log e-values, largest first.
        tried: number of effects from which these were chosen.
        false_share: of false discoveries that is allowed.
    """
    found = np.inf
    for count, value in enumerate(values, start=1):
        needed = float(np.log(tried / (count * false_share)))
        if value >= needed:
            found = needed
    return found


@dataclass(frozen=True, eq=False)
class _Half:
    """One half of the data, and the model without effects fitted to it.

    Attributes:
        problem: the half.
        base: the model.
    """

    problem: Likelihood
    base: Fit

    @staticmethod
    def of(problem: Likelihood, base: Fit, number: int) -> "_Half":
        own = about(problem.half(number), base)
        return _Half(own, fit(own, base.placed, base.z, FIT.first_steps))

    def values(self, one: Fit) -> Tensor:
        """Parameters of the last effect of a fit, by this half."""
        fitted = self._fitted(one, one.z)
        return fitted.z[len(fitted.z) - _count(one) :]

    def gain(self, one: Fit, values: Tensor) -> float:
        """Log density over that of the model without the last effect, which is held."""
        with_it = self._fitted(one, one.z, values)
        return log_posterior(self.problem, with_it) - log_posterior(self.problem, self.base)

    def _fitted(self, one: Fit, start: Tensor, held: Tensor | None = None) -> Fit:
        """A fit to this half by the errors that are likeliest for all data."""
        at = self.problem.at_row(one.likelihood.row)
        where = one.steps if held is None else one.steps.holding(held)
        return fit(at, one.placed, start, FIT.first_steps, where)


def _count(one: Fit) -> int:
    return len(one.placed[-1].effect.parameters)
