"""The two likelihoods of the stiffness factors: amortised (latent) and of the data themselves."""

import copy
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.frf import log_frf_batches
from femupdate.dynamics.modal import ModalData, modal_data
from femupdate.dynamics.reduced import ReducedModel
from femupdate.errors import SurrogateError
from femupdate.inference.encoder_input import encoder_input
from femupdate.inference.folded_encoder import FoldedEncoder
from femupdate.measurement.observation import Observation
from femupdate.surrogate.latent import latent_log_likelihood
from femupdate.surrogate.network import LatentGaussian, Visibility
from femupdate.surrogate.storage import TrainedSurrogate

# Modes kept for a response: with 32 the six-story building's ln|H| is within .008 rms at the
# lowest damping of its prior, far below any measured noise.
_MODES = 40
_CPU_ROWS = 512


class LatentLikelihood:
    """ln of the latent likelihood of theta for one observation.

    Args:
        surrogate: trained for the building.
        observation: on the surrogate's frequency grid.
        device: where to evaluate.
        power: that the likelihood is raised to; default the surrogate's own, from its calibration.

    Raises:
        SurrogateError: the observation is on another grid.
        MeasurementError: see `encoder_input`.
    """

    def __init__(
        self,
        surrogate: TrainedSurrogate,
        observation: Observation,
        device: torch.device | str = "cpu",
        power: float | None = None,
    ) -> None:
        if observation.frequency_hz.size != surrogate.mvae.sizes.points:
            raise SurrogateError(
                f"the surrogate knows {surrogate.mvae.sizes.points} frequencies, the observation "
                f"has {observation.frequency_hz.size}; use the building's frequency grid"
            )
        self.input = encoder_input(observation, surrogate.info.floors)
        self.power = surrogate.info.likelihood_power if power is None else power
        # A module moves in place: the caller's stays where it is.
        self._mvae = copy.deepcopy(surrogate.mvae).to(device)
        self._visibility = Visibility(
            self.input.visibility.floors.to(device), self.input.visibility.band.to(device)
        )
        with torch.no_grad():
            self.posterior_z: LatentGaussian = self._mvae.encode_observation(
                self.input.log_frf.to(device), self._visibility
            )
        self._encoder = FoldedEncoder(self._mvae, self._visibility)

    def __call__(self, theta: Tensor) -> Tensor:
        """Log likelihood (n,), float32, of theta (n, p), on the device of theta."""
        known = theta.to(self.posterior_z.mean)
        # On a CPU in parts that stay in its cache, so that memory does not grow with the particles.
        parts = known.split(_CPU_ROWS if known.device.type == "cpu" else len(known))
        with torch.inference_mode():
            return torch.cat([self._values(rows) for rows in parts]).to(theta.device)

    def _values(self, theta: Tensor) -> Tensor:
        q = self._encoder(theta)
        value = latent_log_likelihood(
            self.posterior_z.mean, self.posterior_z.variance, q.mean, q.variance
        )
        return self.power * value

    def reconstruction_misfit(self, noise_sd: float) -> float:
        """Mean squared misfit of the observation's reconstruction from its own z, whitened.

        About 1 for data like those of the training. The variance is that of the noise and what
        the decoder itself leaves. Where the observation is unlike any simulation no z explains it.
        """
        visible = self._visibility.weights(self._mvae.sizes.points)
        with torch.inference_mode():
            mean, log_excess = self._mvae.decoder(self.posterior_z.mean)
            scale = self._mvae.x_scale
            predicted = self._mvae.x_mean + scale * mean
            variance = noise_sd**2 + scale**2 * log_excess.exp()
            observed = self.input.log_frf.to(predicted)
            squares = (observed - predicted) ** 2 / variance * visible
        return float(squares.sum() / visible.sum())


@dataclass(frozen=True)
class DataTerms:
    """An observation as the data-space likelihood takes it.

    Attributes:
        rows: which of the model's floors are observed.
        log_frf: (f, k); zero where not valid.
        weight: (f, k) 1 / sd^2, zero where not valid.
        independent: share of the points that err independently of their neighbours.
    """

    rows: tuple[int, ...]
    log_frf: Tensor
    weight: Tensor
    independent: float

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
    spacing = float(np.median(np.diff(observation.frequency_hz)))
    resolution = observation.resolution_hz or spacing
    values = torch.from_numpy(np.nan_to_num(observation.log_frf))
    noise = torch.from_numpy(np.nan_to_num(observation.noise_sd, nan=1.0))
    return DataTerms(
        tuple(floors.index(name) for name in observation.floors),
        torch.where(valid, values, 0.0),
        torch.where(valid, noise**-2, 0.0),
        min(1.0, spacing / resolution),
    )


class DataLikelihood:
    """ln exp(-|r|^2 / 2) of the whitened residuals r of ln|H|, by the reduced model.

    Where the damping ratio is a nuisance it is the last column of the parameters.

    Args:
        model: reduced model.
        law: damping law.
        observation: on `observation.frequency_hz`.
        zeta: fixed damping ratio, or None where it is the last parameter.
        batch: responses at a time; default what is fastest.
        device: where to evaluate.
        precision: of the responses; modes are always solved in float64. float32 takes half the
            time and moves the log likelihood by a few thousandths.
    """

    def __init__(
        self,
        model: ReducedModel,
        law: DampingLaw,
        observation: Observation,
        zeta: float | None = None,
        *,
        batch: int | None = None,
        device: torch.device | str = "cpu",
        precision: torch.dtype = torch.float64,
    ) -> None:
        self._model = model
        self._law = law
        self._zeta = zeta
        self._batch = batch
        self._device = device
        self._precision = precision
        self._frequency = torch.from_numpy(observation.frequency_hz).to(device)
        self.terms = data_terms(observation, model.floors)

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p) or, with zeta last, (n, p + 1)."""
        return -0.5 * self.terms.independent * self.misfit(parameters)

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
        count = self._model.parameters
        theta = parameters[:, :count]
        if self._zeta is None:
            return self._batches(theta, parameters[:, count])
        return self._batches(theta, theta.new_full((len(theta),), self._zeta))

    def _batches(self, theta: Tensor, zeta: Tensor) -> Iterator[Tensor]:
        modal = modal_data(
            self._model,
            theta,
            modes=_MODES,
            top_frequency_hz=float(self._frequency[-1]),
            device=self._device,
        )
        rows = list(self.terms.rows)
        seen = ModalData(modal.omega, modal.effect[:, rows], modal.residual[:, rows])
        return log_frf_batches(
            seen.to(self._device, self._precision),
            self._frequency,
            self._law,
            zeta,
            batch=self._batch,
        )

    def _misfit(self, predicted: Tensor) -> Tensor:
        residual = (predicted - self.terms.log_frf.to(predicted)) ** 2
        weighted = residual * self.terms.weight.to(predicted)
        return weighted.sum((1, 2), dtype=torch.float64)
