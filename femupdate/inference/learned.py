"""The likelihood of measured data by a model that may err, and where it is highest."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor

from femupdate.dynamics.closed_form import Estimate
from femupdate.dynamics.system import System
from femupdate.inference.joint import Kind
from femupdate.inference.likelihood import DataLikelihood
from femupdate.inference.maxima import found_from
from femupdate.inference.model_error import LearnedError
from femupdate.inference.parameters import Parameters
from femupdate.inference.prior_search import best_of_prior
from femupdate.inference.thresholds import DRAWS, LEARNED_ERROR
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed
from femupdate.surrogate.gauss_newton import Descent


class SharedErrors(Protocol):
    """Errors of a model that many points of an observation share."""

    def __call__(
        self,
        parameters: Tensor,
        frequency_hz: Tensor,
        zeta: Tensor,
        seen: Estimate | None = None,
    ) -> Tensor:
        """Changes of ln|H| (n, c, f, k) by one standard deviation of every error."""
        ...


@dataclass(frozen=True, eq=False)
class LearnedLikelihood:
    """ln of the density of an observation, the error of the model summed over.

    Attributes:
        data: residuals of the observation, whitened by its noise.
        error: of the model.
        others: likelihoods of what else was measured, which the error does not concern.
    """

    data: DataLikelihood
    error: LearnedError
    others: tuple[Kind, ...] = ()

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        value = self.error.log_density(self.data.residuals(parameters))
        scatter = 0.5 * self.data.terms.independent * self.data.terms.scatter
        value = (value - scatter).to(parameters.device)
        return value + self._of_others(parameters)

    @property
    def floors(self) -> None:
        """Those of the observation."""
        return None

    def missed(self, parameters: Tensor) -> Tensor:
        """Residuals (n, f k) of ln|H| of parameters (n, p), by the noise alone."""
        return self.data.residuals(parameters)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Whitened residuals (n, m) by the likeliest error, the first of the table."""
        return self.at_row(0)(parameters)

    def log_densities(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n, g) of parameters (n, p) by every row of the table."""
        values = self.error.log_densities(self.data.residuals(parameters))
        return values + self._of_others(parameters)[:, None]

    def at_row(self, row: int) -> Callable[[Tensor], Tensor]:
        """Whitened residuals (n, m) of parameters (n, p), were a row of the table true."""

        def residuals(parameters: Tensor) -> Tensor:
            own = self.error.whiten(self.data.residuals(parameters), row)
            return torch.cat([own, *(one.residuals(parameters) for one in self.others)], dim=1)

        return residuals

    def _of_others(self, parameters: Tensor) -> Tensor:
        return sum((one(parameters) for one in self.others), parameters.new_zeros(len(parameters)))


@dataclass(frozen=True, eq=False)
class Settled:
    """Where the likelihood is highest, and what the error of the model may be there.

    Attributes:
        likelihood: summed over the rows of the table that count, the likeliest first.
        found: maxima by the likeliest of them, in standard normal coordinates.
    """

    likelihood: LearnedLikelihood
    found: Descent


def learned_error(
    data: DataLikelihood, observation: Observation, known: Tensor | None = None
) -> LearnedError:
    """The error that residuals of an observation may hold.

    Args:
        data: residuals of the observation.
        observation: on its grid.
        known: (c, f, k) changes of ln|H| by one standard deviation of every error that is known.
    """
    terms = data.terms
    weight, frequency = terms.independent * terms.weight, torch.from_numpy(observation.frequency_hz)
    points = terms.independent * float((weight > 0).sum())
    if known is None:
        return LearnedError(weight, frequency, points)
    steps = torch.cat([known.to(weight), _of_points_that_bend(known, weight)])
    return LearnedError(weight, frequency, points, (steps * weight.sqrt()).flatten(1))


def _of_points_that_bend(known: Tensor, weight: Tensor) -> Tensor:
    """An error (c, f, k) for every point that the known ones change by too much for a line.

    At the bottom of an anti-resonance a thousandth of the frequency multiplies |H|. A line from
    there would let that one point tell what no other point tells.
    """
    away = known.square().sum(0).sqrt()
    floors, points = ((away > LEARNED_ERROR.bends) & (weight > 0)).nonzero(as_tuple=True)
    own = weight.new_zeros(len(floors), *weight.shape)
    own[torch.arange(len(floors)), floors, points] = LEARNED_ERROR.bent * away[floors, points]
    return own


def settled(
    prior: Parameters,
    system: System,
    observation: Observation,
    seed: Seed,
    *,
    starts: Tensor | None = None,
    device: torch.device | str = "cpu",
    shared: SharedErrors | None = None,
    others: tuple[Kind, ...] = (),
) -> Settled:
    """The maxima of the likelihood of an observation, and the errors of the model that count there.

    Args:
        prior: of the parameters.
        system: the building.
        observation: of it.
        seed: of the points of the prior from which the search starts without `starts`.
        starts: (s, p) parameters, one at least near every maximum.
        device: where responses are computed.
        shared: errors of the model that all points share.
        others: likelihoods of what else was measured.
    """
    # All modes in double precision: smooth in the parameters.
    data = DataLikelihood(system, observation, device=device, modes=None)
    likelihood = LearnedLikelihood(data, learned_error(data, observation), others)
    if starts is None:
        wide = likelihood.at_row(likelihood.error.start)
        starts, _ = best_of_prior(prior, lambda some: -0.5 * wide(some).square().sum(1), seed)
    if shared is None:
        return settle(prior, likelihood, starts)
    found = found_from(prior, likelihood.at_row(likelihood.error.start), starts)
    rough = prior.from_normal(found.z)

    def known(parameters: Tensor) -> Tensor:
        return shared_changes(shared, prior, parameters, observation)[0, :, data.terms.rows]

    error = learned_error(data, observation, known(rough[:1]))
    ended = settle(prior, replace(likelihood, error=error), rough)
    # Lines from beside the maximum would tell errors from factors that do the same.
    again = learned_error(data, observation, known(prior.from_normal(ended.found.z[:1])))
    error = ended.likelihood.error.with_known_of(again)
    return replace(ended, likelihood=replace(ended.likelihood, error=error))


def shared_changes(
    shared: SharedErrors, prior: Parameters, parameters: Tensor, observation: Observation
) -> Tensor:
    """What shared errors do to ln|H| (n, c, f, k) of all floors, as measured."""
    values = prior.split(parameters.cpu())
    seen = observation.estimator
    asked = observation.frequency_hz if seen is None else seen.frequency_hz
    theta = torch.cat([values.theta, values.sizes], dim=1)
    return shared(theta, torch.from_numpy(asked), values.zeta, seen)


def settle(
    prior: Parameters,
    likelihood: LearnedLikelihood,
    starts: Tensor,
) -> Settled:
    """Find the maxima from starts (s, p), and the rows of the table that count there.

    Fits begin as if the model erred much, so that no few points decide; the likeliest error at
    their end is taken for the next, and at last none.
    """
    fits = _Fits(prior, likelihood)
    fits.follow(starts, likelihood.error.start)
    row, points = fits.best
    finer = replace(likelihood, error=likelihood.error.finer(row))
    if row == 0:
        return fits.by_more_rows(finer).settled()
    fits = _Fits(prior, finer)
    fits.follow(points, fits.likeliest(points))
    return fits.settled()


class _Fits:
    """Maxima at rows of an error's table, one after the other."""

    def __init__(self, prior: Parameters, likelihood: LearnedLikelihood) -> None:
        self._prior, self._likelihood = prior, likelihood
        self._found: dict[int, Descent] = {}
        self._densities: dict[int, Tensor] = {}

    def follow(self, starts: Tensor, row: int) -> None:
        """Fit from starts (s, p) at a row, then at the likeliest there, and at last at none."""
        for _ in range(LEARNED_ERROR.rounds):
            self._fit(starts, row)
            starts = self._prior.from_normal(self._found[row].z)
            row = int(self._densities[row].max(0).values.argmax())
            if row in self._found:
                break
        if 0 not in self._found:
            self._fit(starts, 0)

    def by_more_rows(self, likelihood: LearnedLikelihood) -> "_Fits":
        """The same maxima judged by a table that has further rows behind its own."""
        more = _Fits(self._prior, likelihood)
        more._found = self._found
        more._densities = {
            row: more._log_posterior(self._prior.from_normal(found.z))
            for row, found in self._found.items()
        }
        return more

    @property
    def best(self) -> tuple[int, Tensor]:
        """The likeliest row, and the maxima (s, p) from which that was found."""
        at = max(self._densities, key=lambda row: float(self._densities[row].max()))
        points = self._prior.from_normal(self._found[at].z)
        return int(self._densities[at].max(0).values.argmax()), points

    def likeliest(self, points: Tensor) -> int:
        """The likeliest row at points (s, p)."""
        return int(self._log_posterior(points).max(0).values.argmax())

    def settled(self) -> Settled:
        """With the rows that count alone."""
        row, points = self.best
        if row not in self._found:
            self._fit(points, row)
        every = torch.cat(list(self._densities.values()))
        error = self._likelihood.error
        # The likeliest comes first.
        rows = [row, *(one for one in error.counting(every) if one != row)]
        kept = replace(self._likelihood, error=error.kept(rows))
        return Settled(kept, self._found[row])

    def _fit(self, starts: Tensor, row: int) -> None:
        residuals = self._likelihood.at_row(row)
        self._found[row] = found_from(self._prior, residuals, starts)
        points = self._prior.from_normal(self._found[row].z)
        self._densities[row] = self._log_posterior(points)

    def _log_posterior(self, points: Tensor) -> Tensor:
        """(s, g) at points (s, p) by every row."""
        own = self._prior.log_density_normal(
            self._prior.to_normal(points).clamp(-DRAWS.edge, DRAWS.edge)
        )
        return self._likelihood.log_densities(points) + own[:, None]
