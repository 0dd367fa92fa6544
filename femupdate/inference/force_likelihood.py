"""Likelihood of responses to a force at a floor, by the reduced model."""

from collections.abc import Iterator

import torch
from torch import Tensor

from femupdate.dynamics.force_response import RestFlexibility, accelerance
from femupdate.dynamics.system import System
from femupdate.inference.likelihood import data_terms
from femupdate.measurement.force_frf import ForcedObservation

_ROWS = 256
_TINY = 1e-30


class ForceLikelihood:
    """ln exp(-|r|^2 / 2) of the whitened residuals r of ln|A|, A the accelerance of the floors.

    Where the damping ratio is unknown it is the last column of the parameters.

    Args:
        system: the reduced model.
        forced: responses to a force at one floor.
        zeta: fixed damping ratio, or None where it is the last parameter.
        rest: static displacement that the reduced model lacks.
    """

    def __init__(
        self,
        system: System,
        forced: ForcedObservation,
        zeta: float | None = None,
        rest: RestFlexibility | None = None,
    ) -> None:
        self._system, self._zeta, self._rest = system, zeta, rest
        self._frequency = torch.from_numpy(forced.observation.frequency_hz)
        self._forced = system.floors.index(forced.force)
        self.terms = data_terms(forced.observation, system.floors)
        self.names = tuple(f"{name}/{forced.force}" for name in forced.observation.floors)
        self._used = (self.terms.weight > 0.0).any(dim=0)
        estimator = forced.observation.estimator
        # Of histories, the model's response goes through the same means as the measured one.
        self._seen = None if estimator is None else estimator.at(self._used.numpy())
        seen = self._seen
        self._asked = self.frequency_hz if seen is None else torch.from_numpy(seen.frequency_hz)

    @property
    def freedom(self) -> tuple[float, ...]:
        """Independent points of every floor that responds."""
        return tuple((self.terms.independent * (self.terms.weight > 0.0).sum(dim=1)).tolist())

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p) or, with zeta last, (n, p + 1)."""
        return -0.5 * self.squares(parameters).sum(dim=1)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Whitened residuals (n, m): minus half their square is the log likelihood."""
        return torch.cat([part.flatten(1) for part in self._residuals(parameters)])

    def squares(self, parameters: Tensor) -> Tensor:
        """Sums of squared whitened residuals (n, f) of every floor that responds."""
        return torch.cat([part.square().sum(dim=2) for part in self._residuals(parameters)])

    def predict(self, parameters: Tensor) -> Tensor:
        """ln|A| (n, f, k) of the floors that respond, at the frequencies that are used."""
        return torch.cat(list(self._predicted(parameters)))

    @property
    def measured(self) -> Tensor:
        """ln|A| (f, k) as measured, at the frequencies that are used; NaN where not valid."""
        there = self.terms.weight > 0.0
        return torch.where(there, self.terms.log_frf, torch.nan)[:, self._used]

    @property
    def frequency_hz(self) -> Tensor:
        """(k,) frequencies that are used."""
        return self._frequency[self._used]

    def _residuals(self, parameters: Tensor) -> Iterator[Tensor]:
        root = (self.terms.independent * self.terms.weight).sqrt()[:, self._used]
        measured = self.terms.log_frf[:, self._used]
        return (root * (values - measured) for values in self._predicted(parameters))

    def _predicted(self, parameters: Tensor) -> Iterator[Tensor]:
        count = self._system.parameters
        for rows in parameters.to("cpu", torch.float64).split(_ROWS):
            known = self._zeta is not None
            zeta = rows.new_full((len(rows),), self._zeta or 0.0) if known else rows[:, count]
            values = accelerance(
                self._system, rows[:, :count], zeta, self._asked, self._forced, self._rest
            )[:, list(self.terms.rows)]
            seen = values if self._seen is None else self._seen(values)
            yield seen.abs().clamp_min(_TINY).log()
