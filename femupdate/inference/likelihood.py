"""The two likelihoods of the stiffness factors: amortised (latent) and of the data themselves."""

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
import torch
from scipy.stats import chi2
from torch import Tensor
from torch.nn.functional import pad

from femupdate.dynamics.system import Responses, System
from femupdate.errors import SurrogateError
from femupdate.inference.encoder_input import encoder_input
from femupdate.inference.latent_search import Control, find_latent
from femupdate.measurement.estimated import as_estimated, segment_of
from femupdate.measurement.observation import Observation, independent_share
from femupdate.seeds import torch_generator
from femupdate.surrogate.gauss_newton import LatentData
from femupdate.surrogate.latent import LatentQuadratics
from femupdate.surrogate.network import Mvae
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.surrogate.visibility import Visibility

# Modes kept for a response. At a noise of .01 on the six-story building's ln|H|, 40 modes move the
# log likelihood of a good fit by hundreds, 100 modes by .03.
MODES = 100
_CPU_ROWS = 4096
_ROWS = 1024
_SEARCH_SEED = 0
# Share of observations whose misfit is usual.
_USUAL = 0.995


class SharedErrors(Protocol):
    """Errors of a model that many points of an observation share."""

    def __call__(
        self,
        parameters: Tensor,
        frequency_hz: Tensor,
        zeta: Tensor,
        seen: Callable[[Tensor], Tensor] | None = None,
    ) -> Tensor:
        """Changes of ln|H| (n, c, f, k) by one standard deviation of every error."""
        ...


class LatentLikelihood:
    """ln of the latent likelihood of theta for one observation.

    Args:
        surrogate: trained for the building.
        system: the building's reduced model, with its effects if it lists any, of which some
            hundreds of responses are asked.
        observation: on the surrogate's frequency grid.
        device: where to evaluate.
        power: that the likelihood is raised to; default the surrogate's own, from its calibration.
        least_noise: standard deviation of ln|H| below which the file's noise is not believed:
            idealisation errs as well; default that of the surrogate's training.
        shared: errors of the model that all points share.

    Attributes:
        input: the observation as the encoder sees it.
        proposal: what the observation encoder says.
        found: q(z|x), and what it took to find it.
        usual_misfit: what 199 in 200 observations of the building's own kind stay below.
        power: of the likelihood.

    Raises:
        SurrogateError: the observation is on another frequency grid.
        MeasurementError: see `encoder_input`.
    """

    def __init__(
        self,
        surrogate: TrainedSurrogate,
        system: System,
        observation: Observation,
        *,
        device: torch.device | str = "cpu",
        power: float | None = None,
        least_noise: float | None = None,
        shared: SharedErrors | None = None,
    ) -> None:
        if observation.frequency_hz.size != surrogate.mvae.sizes.points:
            raise SurrogateError(
                f"the surrogate knows {surrogate.mvae.sizes.points} frequencies, the observation "
                f"has {observation.frequency_hz.size}; use the building's frequency grid"
            )
        self.input = encoder_input(observation, surrogate.info.floors)
        self.power = surrogate.info.likelihood_power if power is None else power
        # A module moves in place: the caller's stays where it is.
        self._mvae = copy.deepcopy(surrogate.mvae).to(device).requires_grad_(False)
        floor = surrogate.info.noise_sd if least_noise is None else least_noise
        clean = latent_data(observation, surrogate.info.floors, floor, device)
        seen = self.input.visibility
        visibility = Visibility(seen.floors.to(device), seen.band.to(device))
        with torch.no_grad():
            self.proposal = self._mvae.encode_observation(self.input.log_frf.to(device), visibility)
        # The search is short and the same for an observation whatever the seed of the sampler.
        generator = torch_generator(_SEARCH_SEED)
        control = Control(
            clean,
            floor_responses(system, observation, clean.log_frf),
            None if shared is None else _shared_changes(shared, observation),
        )
        self.found = find_latent(
            self._mvae, _with_decoder_error(clean, self._mvae), self.proposal, control, generator
        )
        self.usual_misfit = usual_misfit(observation)
        # theta says where z is, but for the coordinate of the damping.
        sizes = self._mvae.sizes
        spread = torch.diag(torch.arange(sizes.coordinates) >= sizes.parameters)
        self._quadratics = LatentQuadratics(self.found.posterior, spread, device)

    def __call__(self, theta: Tensor) -> Tensor:
        """Log likelihood (n,), float32, of theta (n, p), on the device of theta."""
        known = theta.to(self._mvae.lower)
        # On a CPU in parts that stay in its cache, so that memory does not grow with the particles.
        parts = known.split(_CPU_ROWS if known.device.type == "cpu" else len(known))
        free = self._mvae.sizes.coordinates - known.shape[1]
        places = (pad(self._mvae.encode_parameters(rows), (0, free)) for rows in parts)
        values = torch.cat([self._quadratics(rows) for rows in places])
        return self.power * values.to(theta.device)

    @torch.no_grad()
    def solutions(self, most: int = 16, drawn: int = 8) -> Tensor:
        """Parameters (s, p) of the heaviest solutions and of some draws of q(z|x).

        The damping ratio comes last. Two solutions that a smaller noise would
        tell apart may be one here: the draws about it lead to both.
        """
        found, generator = self.found.posterior, torch_generator(_SEARCH_SEED)
        heavy = found.log_weight.topk(min(most, len(found.log_weight))).indices
        chosen = torch.multinomial(found.log_weight.exp(), drawn, True, generator=generator)
        noise = torch.randn(drawn, found.mean.shape[1], 1, generator=generator).to(found.mean)
        root = torch.linalg.cholesky(torch.linalg.inv(found.precision[chosen]))
        away = found.mean[chosen] + (root @ noise)[..., 0]
        mvae = copy.deepcopy(self._mvae).double()
        z = torch.cat([found.mean[heavy], away]).to(mvae.lower)
        theta = mvae.parameters_at(z)
        return torch.cat([theta, mvae.decoder.damping(z)[:, None]], dim=1)


def latent_data(
    observation: Observation,
    floors: tuple[str, ...],
    least_noise: float,
    device: torch.device | str = "cpu",
) -> LatentData:
    """An observation on the surrogate's floors, with the weight of each point.

    Points that repeat one another (see `data_terms`) count as if they were noisier.
    """
    terms = data_terms(observation, floors)
    rows = list(terms.rows)
    log_values = torch.zeros(len(floors), observation.frequency_hz.size, dtype=torch.float64)
    log_values[rows] = terms.log_frf
    precision = torch.zeros_like(log_values)
    precision[rows] = terms.independent * terms.weight
    return LatentData(log_values.to(device), precision.clamp_max(least_noise**-2).to(device))


def usual_misfit(observation: Observation) -> float:
    """What 199 in 200 observations stay below: the chi-square's quantile, a valid point."""
    free = max(1.0, int(observation.valid.sum()) * independent_share(observation))
    return float(chi2.ppf(_USUAL, free) / free)


def _with_decoder_error(data: LatentData, mvae: Mvae) -> LatentData:
    """The same in single precision, where the decoder, which errs as well, responds."""
    weight = data.weight.to(mvae.lower)
    return LatentData(
        data.log_frf.to(mvae.lower), weight / (1.0 + weight * mvae.decoder.excess_variance())
    )


def floor_responses(
    system: System, observation: Observation, like: Tensor
) -> Callable[[Tensor, Tensor], Tensor]:
    """The reduced model's ln|H| (n, f, k) at theta (n, p) and damping ratios (n,).

    On the surrogate's floors, as `like` (f, k) has them; zero where not observed.
    """
    # Differences of these are taken: they must be smooth.
    exact = DataLikelihood(system, observation, device=like.device, modes=None)
    rows = list(exact.terms.rows)

    def respond(theta: Tensor, zeta: Tensor) -> Tensor:
        values = theta.new_zeros(len(theta), *like.shape)
        values[:, rows] = exact.predict(theta, zeta).to(values)
        return values

    return respond


def _shared_changes(
    shared: SharedErrors, observation: Observation
) -> Callable[[Tensor, Tensor], Tensor]:
    """What shared errors do to ln|H| (n, c, f, k) as this observation would show it."""
    frequency, seen = torch.from_numpy(observation.frequency_hz), _estimate(observation)

    def changes(theta: Tensor, zeta: Tensor) -> Tensor:
        return shared(theta.cpu(), frequency, zeta.cpu(), seen).to(theta)

    return changes


def _estimate(observation: Observation) -> Callable[[Tensor], Tensor]:
    """What the estimate behind an observation makes of complex FRFs (n, f, k)."""
    return partial(
        as_estimated,
        segment_s=segment_of(observation),
        frequency_hz=torch.from_numpy(observation.frequency_hz),
    )


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
        modes: int | None = MODES,
    ) -> None:
        self._system = system
        self._zeta = zeta
        self._device = device
        self._frequency = torch.from_numpy(observation.frequency_hz).to(device)
        self.terms = data_terms(observation, system.floors)
        self._how = Responses(
            modes=None if system.placed else modes,
            precision=precision,
            floors=self.terms.rows,
            seen=_estimate(observation) if system.placed else None,
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

    def predict(self, theta: Tensor, zeta: Tensor) -> Tensor:
        """ln|H| (n, f, k) of the observed floors."""
        return torch.cat(list(self._batches(theta, zeta)))

    def _responses(self, parameters: Tensor) -> Iterator[Tensor]:
        count = self._system.parameters
        theta = parameters[:, :count]
        if self._zeta is None:
            return self._batches(theta, parameters[:, count])
        return self._batches(theta, theta.new_full((len(theta),), self._zeta))

    def _batches(self, parameters: Tensor, zeta: Tensor) -> Iterator[Tensor]:
        known = parameters.to(self._device, torch.float64), zeta.to(self._device, torch.float64)
        for some, ratio in zip(*(part.split(_ROWS) for part in known), strict=True):
            yield self._system.log_frf(some, ratio, self._frequency, self._how)

    def _misfit(self, predicted: Tensor) -> Tensor:
        residual = (predicted - self.terms.log_frf.to(predicted)) ** 2
        weighted = residual * self.terms.weight.to(predicted)
        return weighted.sum((1, 2), dtype=torch.float64)
