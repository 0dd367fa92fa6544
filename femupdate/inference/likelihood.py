"""The likelihood of the parameters by the data themselves, as if the model were right."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from femupdate.dynamics.system import Responses, System
from femupdate.inference.thresholds import DRAWS
from femupdate.measurement.observation import Observation, independent_share

_ROWS = 1024


@dataclass(frozen=True)
class DataTerms:
    """An observation as the data-space likelihood takes it.

    Attributes:
        rows: which of the model's floors are observed.
        log_frf: (f, k); zero where not valid.
        weight: (f, k) 1 / sd^2, zero where not valid.
        independent: share of the points that err independently of their neighbours.
        scatter: of several runs about what they were pooled into, see `Observation`.
    """

    rows: tuple[int, ...]
    log_frf: Tensor
    weight: Tensor
    independent: float
    scatter: float = 0.0

    @property
    def count(self) -> int:
        """Number of valid points."""
        return int((self.weight > 0).sum())


def data_terms(observation: Observation, floors: tuple[str, ...]) -> DataTerms:
    """Weights of an observation's points; see `DataTerms`.

    Points closer than the resolution of the FRF estimate repeat one another: the log likelihood is
    scaled by spacing over resolution, so that it counts independent points.
    """
    valid = torch.from_numpy(observation.valid)
    values = torch.from_numpy(np.nan_to_num(observation.log_frf))
    noise = torch.from_numpy(np.nan_to_num(observation.noise_sd, nan=1.0))
    scatter = observation.scatter
    return DataTerms(
        tuple(floors.index(name) for name in observation.floors),
        torch.where(valid, values, 0.0),
        torch.where(valid, noise**-2, 0.0),
        independent_share(observation),
        0.0 if scatter is None else float(scatter[observation.valid].sum()),
    )


class DataLikelihood:
    """ln exp(-|r|^2 / 2) of the whitened residuals r of ln|H|, by the reduced model.

    Of several runs pooled into one observation it is the sum over the runs: the residuals of what
    was pooled, and the scatter about it, which is the same for all parameters.

    Where the damping ratio is a nuisance it is the last column of the parameters.

    Args:
        system: the reduced model with its effects, whose sizes follow theta. Responses of a
            building that lists effects are blunted as the estimate of an observation is.
        observation: on `observation.frequency_hz`.
        zeta: fixed damping ratio, or None where it is the last parameter.
        batch: responses at a time; default what is fastest.
        device: where to evaluate.
        precision: of the responses; modes are always solved in float64. float32 takes half the
            time and moves the log likelihood by a few thousandths.
        modes: kept for a response; all where None, which makes responses smooth in theta: which
            modes are kept changes from place to place.
    """

    def __init__(
        self,
        system: System,
        observation: Observation,
        zeta: float | None = None,
        *,
        batch: int | None = None,
        device: torch.device | str = "cpu",
        precision: torch.dtype = torch.float64,
        modes: int | None = DRAWS.modes,
    ) -> None:
        seen = observation.estimator
        if system.changes_in_run and seen is not None and seen.run_levels:
            system = replace(system, run_levels=seen.run_levels)
        self._system = system
        self._zeta = zeta
        self._device = device
        asked = observation.frequency_hz if seen is None else seen.frequency_hz
        self._frequency = torch.from_numpy(asked).to(device)
        self.terms = data_terms(observation, system.floors)
        self._how = Responses(
            modes=None if system.placed else modes,
            precision=precision,
            floors=self.terms.rows,
            seen=seen,
            batch=batch,
        )

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p) or, with zeta last, (n, p + 1)."""
        squares = self.misfit(parameters) + self.terms.scatter
        return -0.5 * self.terms.independent * squares

    def misfit(self, parameters: Tensor) -> Tensor:
        """Sum of squared whitened residuals (n,), over all valid points."""
        parts = [self._misfit(predicted) for predicted in self._responses(parameters)]
        return torch.cat(parts).to(parameters.device)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Whitened residuals (n, m), zero where not valid: minus half their square is the log."""
        weight = (self.terms.independent * self.terms.weight).sqrt()
        parts = [
            ((predicted - self.terms.log_frf.to(predicted)) * weight.to(predicted)).flatten(1)
            for predicted in self._responses(parameters)
        ]
        return torch.cat(parts).to(parameters.device)

    def explained(self, parameters: Tensor) -> float:
        """Share of the measured variation over frequency that the best of (n, p) has.

        Of the squares, whitened, about the mean of every floor; below zero where that is better.
        """
        terms = self.terms
        weight = terms.independent * terms.weight
        mean = (weight * terms.log_frf).sum(1, True) / weight.sum(1, True).clamp_min(1e-300)
        whole = float((weight * (terms.log_frf - mean) ** 2).sum())
        left = float(self.residuals(parameters).square().sum(1).min())
        return 1.0 - left / max(whole, 1e-300)

    def phase_residuals(self, parameters: Tensor, observation: Observation) -> Tensor:
        """Whitened residuals (n, f k) of the phase, in whose noise ln|H| has its own."""
        weight = (self.terms.independent * self.terms.weight).sqrt()
        assert observation.phase is not None
        measured = torch.from_numpy(np.nan_to_num(observation.phase))
        rows, known = list(self.terms.rows), parameters.to(self._device, torch.float64)
        parts = []
        for some in known.split(_ROWS):
            theta, zeta = self._theta_and_zeta(some)
            structure, sizes = self._system.split(theta)
            frf = self._system.seen_frf(structure, zeta, sizes, self._frequency, self._how.seen)
            turn = frf[:, rows].angle() - measured
            parts.append((torch.remainder(turn + torch.pi, 2.0 * torch.pi) - torch.pi) * weight)
        return torch.cat(parts).flatten(1)

    def predict(self, theta: Tensor, zeta: Tensor) -> Tensor:
        """ln|H| (n, f, k) of the observed floors."""
        return torch.cat(list(self._batches(theta, zeta)))

    def _responses(self, parameters: Tensor) -> Iterator[Tensor]:
        return self._batches(*self._theta_and_zeta(parameters))

    def _theta_and_zeta(self, parameters: Tensor) -> tuple[Tensor, Tensor]:
        count = self._system.parameters
        theta = parameters[:, :count]
        if self._zeta is None:
            return theta, parameters[:, count]
        return theta, theta.new_full((len(theta),), self._zeta)

    def _batches(self, parameters: Tensor, zeta: Tensor) -> Iterator[Tensor]:
        known = parameters.to(self._device, torch.float64), zeta.to(self._device, torch.float64)
        for some, ratio in zip(*(part.split(_ROWS) for part in known), strict=True):
            yield self._system.log_frf(some, ratio, self._frequency, self._how)

    def _misfit(self, predicted: Tensor) -> Tensor:
        residual = (predicted - self.terms.log_frf.to(predicted)) ** 2
        weighted = residual * self.terms.weight.to(predicted)
        return weighted.sum((1, 2), dtype=torch.float64)
