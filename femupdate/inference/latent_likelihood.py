"""The amortised likelihood of the stiffness factors, in the latent space of a surrogate."""

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from scipy.special import chdtri
from torch import Tensor
from torch.nn.functional import pad

from femupdate.arrays import Flags, Floats
from femupdate.dynamics.system import System
from femupdate.errors import MeasurementError, SurrogateError
from femupdate.inference.frf_data import base_logs, frf_data, log_responses
from femupdate.inference.latent_search import find_latent, latent_quadratics
from femupdate.inference.maxima import Settled, on_fewer_shapes
from femupdate.inference.model_error import STATED
from femupdate.maximise import LatentData
from femupdate.measurement.observation import Observation, independent_share
from femupdate.seeds import torch_generator
from femupdate.surrogate.network import EARLIEST_END, LATEST_START, Visibility
from femupdate.surrogate.storage import Surrogate
from femupdate.units import percent


def encoder_input(
    observation: Observation, floors: tuple[str, ...]
) -> tuple[Tensor, Visibility, tuple[str, ...]]:
    """An observation as the observation encoder takes it: one band and no gaps.

    Floors with few usable estimates in the band of most floors are left out. The band that is
    passed on is where all others have them; what is missing inside it is filled by straight lines
    in ln|H|, and the notes say how much.

    Returns:
        ln|H| (1, f, k) of all floors of the surrogate, zero where nothing is observed; which
        floors, and the band that they have in common; what was filled or left out, in sentences.

    Raises:
        MeasurementError: no floor has enough valid points in common with the others.
    """
    usable = _usable(observation)
    used, notes = _choose_floors(observation, floors, usable)
    rows = [observation.floors.index(name) for name in used]
    first, last = _band(_around(usable[rows]).min(axis=0), observation.source)
    points = observation.frequency_hz.size
    log_values = np.zeros((1, len(floors), points))
    mask = np.zeros((1, len(floors)))
    filled = []
    for name, row in zip(used, rows, strict=True):
        column, columns = floors.index(name), usable[row]
        mask[0, column] = 1.0
        known = observation.frequency_hz[columns], observation.log_frf[row, columns]
        log_values[0, column] = np.interp(observation.frequency_hz, *known)
        share = columns[first : last + 1].mean()
        if share < 1.0:
            filled.append(f"{name} {100.0 * (1.0 - share):.1f} %")
    if filled:
        notes.append(f"Interpolated parts of the band: {', '.join(filled)}.")
    band = np.array([[first, last]]) / (points - 1)
    if band[0, 0] > LATEST_START or band[0, 1] < EARLIEST_END:
        low, high = observation.frequency_hz[[first, last]]
        notes.append(
            f"The usable band, {low:.3g} to {high:.3g} Hz, is narrower than the surrogate was "
            "trained for; --exact does not mind."
        )
    visibility = Visibility(torch.from_numpy(mask).float(), torch.from_numpy(band).float())
    return torch.from_numpy(log_values).float(), visibility, tuple(notes)


def _choose_floors(
    observation: Observation, floors: tuple[str, ...], usable: Flags
) -> tuple[list[str], list[str]]:
    """Floors with enough usable points in the band of most floors, and notes on the others."""
    first, last = _band(_around(usable).mean(axis=0), observation.source)
    used, notes = [], []
    for name in (name for name in floors if name in observation.floors):
        share = usable[observation.floors.index(name), first : last + 1].mean()
        if share >= 0.5:
            used.append(name)
        else:
            told = f"{percent(share)} of its points can be used"
            notes.append(f"Floor {name} is left out of the surrogate's proposal: {told}.")
    if not used:
        raise MeasurementError(
            f"{observation.source}: no floor has enough valid points; use a longer record"
        )
    return used, notes


def _usable(observation: Observation) -> Flags:
    """Points (f, m) that the encoder may see: valid, or uncertain but better than a guess."""
    if not observation.valid.any():
        raise MeasurementError(
            f"{observation.source}: no floor has enough valid points; use a longer record"
        )
    finite = np.isfinite(observation.log_frf) & np.isfinite(observation.noise_sd)
    noise = np.where(finite, observation.noise_sd, np.inf)
    low, high = np.flatnonzero(observation.valid.any(axis=0))[[0, -1]]
    span = np.zeros(observation.frequency_hz.size, dtype=bool)
    span[low : high + 1] = True
    uncertain = finite & (noise > 0.0) & (noise <= 0.7) & span
    return np.asarray(observation.valid | uncertain)


def _around(usable: Flags) -> Floats:
    """Share of usable points near every frequency (f, m); zero where no floor is usable at all."""
    width = max(3, usable.shape[1] // 40)
    window = np.ones(width)
    # At the ends of the grid part of the window is missing.
    there = np.convolve(np.ones(usable.shape[1]), window, mode="same")
    near = np.stack([np.convolve(row, window, mode="same") for row in usable]) / there
    return np.where(usable.any(axis=0), near, 0.0)


def _band(share: Floats, source: str) -> tuple[int, int]:
    """First and last frequency around which half can be used; stray points do not count."""
    inside = np.flatnonzero(share >= 0.5)
    if not inside.size:
        raise MeasurementError(
            f"{source}: in no band can most floors be used; leave out the worst floors with "
            "--sensors"
        )
    return int(inside[0]), int(inside[-1])


_SEARCH_SEED = 0


Learning = Callable[[Tensor], Settled]
"""Learns the error of the model together with the maxima that starts (s, p) lead to; may refuse
the data by an error before anything is made of them."""


class LatentLikelihood:
    """ln of the latent likelihood of theta for one observation.

    Args:
        system: the building's reduced model, with its effects if it lists any, of which some
            hundreds of responses are asked.
        observation: on the surrogate's frequency grid.
        least_noise: standard deviation of ln|H| below which the file's noise is not believed:
            idealisation errs as well; default that of the surrogate's training.
        learning: of the error of the model; None where the noise as stated is all there is.

    Attributes:
        visibility, notes: what the encoder sees of it, and what was filled or left out.
        proposal: what the observation encoder says.
        found: q(z|x), and what it took to find it.
        settled: the maxima and what the model errs by, on as few shapes as do about them; None
            where that was not learned.
        usual_misfit: what 199 in 200 observations of the building's own kind stay below.

    Raises:
        SurrogateError: the observation is on another frequency grid.
        MeasurementError: see `encoder_input`.
    """

    def __init__(
        self,
        surrogate: Surrogate,
        system: System,
        observation: Observation,
        *,
        least_noise: float | None = None,
        learning: Learning | None = None,
    ) -> None:
        if observation.frequency_hz.size != surrogate.mvae.sizes.points:
            raise SurrogateError(
                f"the surrogate knows {surrogate.mvae.sizes.points} frequencies, the observation "
                f"has {observation.frequency_hz.size}; use the building's frequency grid"
            )
        log_frf, self.visibility, self.notes = encoder_input(observation, surrogate.info.floors)
        mvae = copy.deepcopy(surrogate.mvae).requires_grad_(False)
        floor = surrogate.info.noise_sd if least_noise is None else least_noise
        clean = latent_data(observation, surrogate.info.floors, floor)
        with torch.no_grad():
            self.proposal = mvae.encode_observation(log_frf, self.visibility)
        # The search is short and the same for an observation whatever the seed of the sampler.
        generator = torch_generator(_SEARCH_SEED)
        self.settled: Settled | None = None

        def settle(starts: Tensor) -> tuple[Tensor, Callable[[Tensor], Tensor]]:
            assert learning is not None
            found = learning(starts)
            likelihood = on_fewer_shapes(found.likelihood, found.found, _SEARCH_SEED)
            self.settled = replace(found, likelihood=likelihood)
            return likelihood.prior.from_normal(found.found.z), likelihood.residuals

        # In single precision, where the decoder, which errs as well, responds.
        weight = clean.weight.to(mvae.lower)
        weight = weight / (1.0 + weight * mvae.decoder.excess_variance())
        self.found = find_latent(
            mvae,
            LatentData(clean.log_frf.to(weight), weight),
            self.proposal,
            (clean, floor_responses(system, observation, clean.log_frf)),
            generator,
            None if learning is None else settle,
        )
        self.usual_misfit = usual_misfit(observation)
        # theta says where z is, but for the coordinate of the damping.
        sizes = mvae.sizes
        spread = torch.diag(torch.arange(sizes.coordinates) >= sizes.parameters)
        self._quadratics = latent_quadratics(self.found, spread)
        self._mvae = mvae

    def __call__(self, theta: Tensor) -> Tensor:
        """Log likelihood (n,), float32, of theta (n, p)."""
        known = theta.to(self._mvae.lower)
        # In parts that stay in the cache, so that memory does not grow with the particles.
        parts = known.split(4096)
        free = self._mvae.sizes.coordinates - known.shape[1]
        places = (pad(self._mvae.encode_parameters(rows), (0, free)) for rows in parts)
        return torch.cat([self._quadratics(rows) for rows in places])

    @torch.no_grad()
    def solutions(self) -> Tensor:
        """Parameters (s, p) of the heaviest solutions and of some draws of q(z|x).

        The damping ratio comes last. Two solutions that a smaller noise would
        tell apart may be one here: the draws about it lead to both.
        """
        found, generator = self.found, torch_generator(_SEARCH_SEED)
        heavy = found.log_weight.topk(min(16, len(found.log_weight))).indices
        chosen = torch.multinomial(found.log_weight.exp(), 8, True, generator=generator)
        noise = torch.randn(8, found.mean.shape[1], 1, generator=generator).to(found.mean)
        root = torch.linalg.cholesky(torch.linalg.inv(found.precision[chosen]))
        away = found.mean[chosen] + (root @ noise)[..., 0]
        mvae = copy.deepcopy(self._mvae).double()
        z = torch.cat([found.mean[heavy], away]).to(mvae.lower)
        theta = mvae.parameters_at(z)
        return torch.cat([theta, mvae.decoder.damping(z)[:, None]], dim=1)


def latent_data(
    observation: Observation, floors: tuple[str, ...], least_noise: float
) -> LatentData:
    """An observation on the surrogate's floors, with the weight of each point.

    Points that repeat one another (see `independent_share`) count as if they were noisier.
    """
    data = frf_data(observation, floors, use_phase=False, table=STATED)
    rows = list(data.rows)
    log_values = torch.zeros(len(floors), observation.frequency_hz.size, dtype=torch.float64)
    log_values[rows] = data.log_frf
    precision = torch.zeros_like(log_values)
    precision[rows] = data.weight
    return LatentData(log_values, precision.clamp_max(least_noise**-2))


def usual_misfit(observation: Observation) -> float:
    """What 199 in 200 observations stay below: the chi-square's quantile, a valid point."""
    free = max(1.0, int(observation.valid.sum()) * independent_share(observation))
    return float(chdtri(free, 1.0 - 0.995) / free)


def floor_responses(
    system: System, observation: Observation, like: Tensor
) -> Callable[[Tensor, Tensor], Tensor]:
    """The reduced model's ln|H| (n, f, k) at theta (n, p) and damping ratios (n,).

    On the surrogate's floors, as `like` (f, k) has them; zero where not observed.
    """
    # Differences of these are taken: they must be smooth.
    data = base_logs(observation, system, modes=None)
    rows = list(data.rows)

    def respond(theta: Tensor, zeta: Tensor) -> Tensor:
        values = theta.new_zeros(len(theta), *like.shape)
        values[:, rows] = log_responses(data, system, theta, zeta).to(values)
        return values

    return respond
