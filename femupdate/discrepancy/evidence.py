"""What speaks for an effect: its evidence, data to which it was not fitted, its consequence.

Evidence is Laplace's approximation about each model's most probable parameters, with the limits of
the parameters taken into account one by one.

Names hold on other data. The data are parted in two halves that err independently. The parameters
of an effect are fitted to one; on the other, stiffness and damping are fitted anew with the effect
held and without it, each with what it may err by. Where they act linearly and the noise is normal,
the ratio of the densities there has an expectation of one if the effect is missing, so it is an
e-value (Vovk and Wang 2021, Ann. Stat. 49, 1736; split likelihood ratios: Wasserman, Ramdas and
Balakrishnan 2020, PNAS 117, 16880); near the likeliest parameters that is nearly so. The mean over
both orders of the halves is one too. The rule of Benjamini and Hochberg for e-values holds the rate
of false discoveries, whatever the dependence (Wang and Ramdas 2022, J. R. Stat. Soc. B 84, 822).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.special import log_ndtr
from torch import Tensor

from femupdate.discrepancy.fit import FIRST_STEPS, Fit, about, densities, fit, log_posterior, settle
from femupdate.inference.event_scatter import DEFAULT
from femupdate.inference.likelihood import Likelihood, summed


def laplace(problem: Likelihood, fitted: Fit) -> float:
    """Log evidence, summed over what the model may err by.

    Up to a constant that all models of the same data share.
    """
    if not np.isfinite(fitted.misfit):  # no structure is left
        return -np.inf
    steps = fitted.steps
    width = steps.upper - steps.lower
    uniform = (steps.precision.diagonal() == 0.0) & torch.isfinite(width) & (width > 0.0)
    # For this curvature what the data leave open fills its limits, and no more: a damping ratio is
    # left open by modes without any.
    open_ = torch.diag(torch.where(uniform, 2.0 * torch.pi / width.square(), 0.0))
    log_det = torch.linalg.slogdet(fitted.hessian() + open_).logabsdet
    value = float(summed(densities(problem, fitted)))
    value += float(log_prior(fitted, fitted.z[None])[0])
    value += 0.5 * steps.size * np.log(2.0 * np.pi) - 0.5 * float(log_det)
    # The share of the normal approximation within the limits, one unknown after the other; where
    # the most probable value sits at its limit, half or less.
    sd = fitted.covariance().diagonal().clamp_min(1e-30).sqrt()
    low, high = ((end - fitted.z) / sd for end in (steps.lower, steps.upper))
    tails = np.exp(log_ndtr(low.numpy())) + np.exp(log_ndtr(-high.numpy()))
    return value + float(np.log(np.clip(1.0 - tails, 1e-12, 1.0)).sum())


def log_prior(fitted: Fit, z: Tensor) -> Tensor:
    """Log prior density (N,) of the unknowns z (N, d) within their limits."""
    steps = fitted.steps
    # Of theta and zeta themselves, seen in their logarithms.
    uniform = fitted.likelihood.prior.of("stiffness", "damping")
    values = steps.values(z)[:, : len(uniform.entries)]
    value = uniform.log_density(values) + z[:, : steps.first_size].sum(dim=1)
    precision = steps.precision.diagonal()
    normal = precision > 0
    root = precision[normal].sqrt()
    scaled, low, high = (
        (value - steps.mean[normal]) * root
        for value in (z[:, normal], steps.lower[normal], steps.upper[normal])
    )
    mass = torch.special.ndtr(high) - torch.special.ndtr(low)
    density = -0.5 * scaled**2 - 0.5 * np.log(2.0 * np.pi) + root.log() - mass.log()
    return value + density.sum(dim=1)


@dataclass(frozen=True)
class Tested:
    """An effect on data to which it was not fitted.

    Attributes:
        log_e_values: of the mean over both orders of the halves; where errors are known
            beforehand, as they are about the base and about the likeliest effect.
        certified: whether the effect holds there.
    """

    log_e_values: tuple[float, ...]
    certified: bool

    @property
    def log_e_value(self) -> float:
        """Of the least, which is an e-value, too."""
        return min(self.log_e_values)


def certify(
    problem: Likelihood, base: Fit, fits: Sequence[Fit], tried: int, false_share: float
) -> dict[str, Tested]:
    """Test fitted effects half against half, by label; none where the data cannot be parted.

    Args:
        base: the model without the effects, fitted to all data.
        fits: with one effect more each, the likeliest first.
        tried: number of effects from which these were chosen.
        false_share: of false discoveries that is allowed.
    """
    if not problem.divisible:
        return {}
    # About the base alone, errors would tell twins apart that explain what it does not.
    places = [base, fits[0]] if problem.error.knows else [base]
    halves = [[_Half.of(problem, base, number, there) for number in (0, 1)] for there in places]
    tests = {}
    for fitted in fits:
        gains = [
            [second.gain(fitted, first.values(fitted)) for first, second in (both, both[::-1])]
            for both in halves
        ]
        log_e_values = tuple(float(np.logaddexp.reduce(orders) - np.log(2.0)) for orders in gains)
        tests[fitted.placed[-1].label] = Tested(log_e_values, False)
    values = sorted((test.log_e_value for test in tests.values()), reverse=True)
    least = least_log_e_value(values, tried, false_share)
    return {k: replace(test, certified=test.log_e_value >= least) for k, test in tests.items()}


def missed_in_turn(fitted: Fit) -> float:
    """Mean squared residual, by the noise alone, of each half of the data by a fit to the other.

    NaN where the data cannot be parted. Unlike in `certify`, stiffness and damping too are those of
    the other half.
    """
    problem = fitted.likelihood
    if not problem.divisible:
        return float("nan")
    first, second = (_Half.of(problem, fitted, number, fitted) for number in (0, 1))
    missed = mean_square(second.problem, first.base), mean_square(first.problem, second.base)
    return float(np.mean(missed))


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
    """
    fitted_to = after.likelihood
    alike = [kind.name for kind in elsewhere.data] == [kind.name for kind in fitted_to.data]
    if alike:
        elsewhere = replace(elsewhere, error=elsewhere.error.with_rows_of(fitted_to.error))
    event = about(elsewhere, before)
    row = before.likelihood.row if alike else event.error.start
    without = settle(event, as_event(event.at_row(row), before))
    row = after.likelihood.row if alike else without.likelihood.row
    with_it = settle(event, as_event(event.at_row(row), after))
    predicted = []
    for fitted in (with_it, without):
        # By the prior of the event, in Laplace's approximation.
        gained = torch.linalg.slogdet(fitted.hessian()).logabsdet
        known = torch.linalg.slogdet(fitted.steps.precision).logabsdet
        predicted.append(log_posterior(event, fitted) - 0.5 * float(gained - known))
    return predicted[0] - predicted[1]


def as_event(elsewhere: Likelihood, fitted: Fit) -> Fit:
    """Another event by a fit's model: its own posterior and the scatter of events are the prior."""
    steps, covariance = fitted.steps, fitted.within_limits()
    covariance[: steps.stories, : steps.stories] += float(DEFAULT.stiffness) ** 2
    if steps.first_size > steps.stories:
        covariance[steps.stories, steps.stories] += float(DEFAULT.damping) ** 2
    prior = steps.about(fitted.z, covariance)
    return fit(elsewhere.of(fitted.likelihood), fitted.placed, fitted.z, steps=prior)


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
    """One half of the data, and the model without effects fitted to it."""

    problem: Likelihood
    base: Fit

    @staticmethod
    def of(problem: Likelihood, base: Fit, number: int, there: Fit) -> "_Half":
        half = about(problem.half(number), there)
        # With 10 and 20 steps log e-values of 24 effects in six fresh sticks move by .1, two of
        # them more (1.3 by .6, 262 by 5), and no certificate changes.
        return _Half(half, fit(half, base.placed, base.z, FIRST_STEPS))

    def values(self, fitted: Fit) -> Tensor:
        """Parameters of the last effect of a fit, by this half."""
        z = self._fitted(fitted).z
        return z[len(z) - len(fitted.placed[-1].effect.parameters) :]

    def gain(self, fitted: Fit, values: Tensor) -> float:
        """Log density over that of the model without the last effect, which is held."""
        with_it = self._fitted(fitted, values)
        return log_posterior(self.problem, with_it) - log_posterior(self.problem, self.base)

    def _fitted(self, fitted: Fit, held: Tensor | None = None) -> Fit:
        """A fit to this half by the errors that are likeliest for all data."""
        at = self.problem.at_row(fitted.likelihood.row)
        steps = fitted.steps if held is None else fitted.steps.holding(held)
        return fit(at, fitted.placed, fitted.z, FIRST_STEPS, steps)


@dataclass(frozen=True)
class Consequence:
    """Largest changes by an effect of its fitted size.

    Attributes:
        frequency: of a natural frequency in the measured band, all else as it is, as a share.
        response: of what a floor reads (rms over the band or the modes, as a share of it), against
            the model without the effect as it is fitted; of an instrument, what it adds.
    """

    frequency: float
    response: float

    def matters(self, frequency: float, response: float) -> bool:
        """Whether either change is at least as large as given."""
        return self.frequency >= frequency or self.response >= response


def consequence(problem: Likelihood, base: Fit, fitted: Fit) -> Consequence:
    """What the last effect of a fit changes, beside the model without it as it is fitted."""
    placed = fitted.placed[-1]
    if placed.exchange:
        return Consequence(0.0, 1.0)
    theta, zeta, sizes = fitted.split
    count = len(placed.effect.parameters)
    without = sizes.clone()
    without[:, -count:] = fitted.steps.parameters.centres[-count:]
    both = [(theta, zeta, size) for size in (sizes, without)]
    instrument = placed.effect.instrument
    system, known = (fitted.system, both[1]) if instrument else (base.system, base.split)
    response = max(
        data.changed(
            data.predicted(system, *known), data.predicted(fitted.system, *both[0]), instrument
        )
        for data in problem.data
    )
    if instrument:
        return Consequence(0.0, response)
    moved = 0.0
    for level in problem.levels:
        found = []
        for theta, zeta, size in both:
            stiffness = fitted.system.at_level(theta, zeta, size, level)[0]
            frequency = fitted.system.modes(stiffness, size).frequency_hz[0]
            found.append(frequency[torch.isfinite(frequency)].sort().values)
        count = min(map(len, found))
        first, second = (values[:count] for values in found)
        seen = (second > 0.0) & (second <= problem.top_hz)
        if seen.any():
            moved = max(moved, float((first[seen] / second[seen] - 1.0).abs().max()))
    return Consequence(moved, response)
