"""Posterior draws with their damping ratios, and what they say of the data."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.special import ndtr
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.finder_model import error_of_sizes
from femupdate.discrepancy.likelihood import EffectLikelihood
from femupdate.discrepancy.problem import own_errors
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.dynamics.system import System
from femupdate.inference.draw_errors import Erring, draw_errors
from femupdate.inference.error_draws import ErrorDraws
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.learned import LearnedLikelihood
from femupdate.inference.likelihood import DataLikelihood
from femupdate.inference.model_error import LearnedError
from femupdate.inference.parameters import Parameter
from femupdate.inference.posterior import Posterior
from femupdate.inference.predictive_check import (
    PredictiveCheck,
    check_predictions,
    predictive_check,
    with_least_noise,
)
from femupdate.measurement.observation import Observation, independent_share
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.workflow.calibrate_settings import CalibrationSettings, Sampled, plain_settings
from femupdate.workflow.kinds import Measured, check_measured, mode_sentences
from femupdate.workflow.model import StudyModel
from femupdate.workflow.thresholds import CALIBRATION


def posterior_of(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    sampled: Sampled,
    latent: FoundLatent | None,
    seed: Seed,
) -> Posterior:
    """The draws, with damping ratios.

    Where theta carries errors of the model no draw of it meets the data, and the damping ratio
    cannot be found from there: then it is the latent posterior's, `latent`.
    """
    observation = measured.as_observation
    shape = len(sampled.results), len(sampled.results[0].theta)
    values = sampled.parameters.split(torch.cat([result.theta for result in sampled.results]))
    theta = _numpy(torch.cat([values.theta, values.sizes], dim=1))
    damping, erring = spawn(seed, 2)
    if not model.damping.free:
        zeta = None
    elif len(values.zeta):
        zeta = _numpy(values.zeta)
    elif latent is None:
        zeta = draw_zeta(model, observation, theta, sampled.learned, damping)
    else:
        zeta = latent_zeta(latent, model.damping, len(theta), damping)
    return Posterior(
        names=model.prior.names,
        theta=theta.reshape(*shape, -1),
        zeta=None if zeta is None else zeta.reshape(shape),
        log_likelihood=np.stack([_numpy(result.log_likelihood) for result in sampled.results]),
        lower=model.prior.lower.numpy(),
        upper=model.prior.upper.numpy(),
        drawn=sampled.drawn,
        observation=observation,
        settings=plain_settings(settings),
        model_error=_errors(model, measured, sampled, (theta, zeta, shape), erring),
    )


def with_error_of_all(posterior: Posterior, model: StudyModel, seed: Seed) -> Posterior:
    """With stiffness factors that allow for what programs differ by in all members alike.

    No data tell that from the factors, so it moves the draws and not the likelihood.
    """
    if model.shared is None:
        return posterior
    count = model.system.factors
    alike = np.random.default_rng(seed).standard_normal(posterior.theta.shape[:2])
    moved = posterior.theta.copy()
    moved[..., :count] *= np.exp(MESH_ERROR.of_all * alike)[..., None]
    return replace(posterior, theta=np.clip(moved, posterior.lower, posterior.upper))


@dataclass(frozen=True)
class _EffectErrors:
    """What a model with effects errs by in FRFs under base motion, the first of its data."""

    likelihood: EffectLikelihood
    data: DataLikelihood

    @property
    def error(self) -> LearnedError:
        """The rows that count."""
        return self.likelihood.error.parts[0]

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of those that were judged."""
        first = self.likelihood.problem.data[0]
        return tuple(self.likelihood.system.floors[row] for row in first.rows)

    def missed(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p), predicted less observed."""
        return -self.likelihood.error.apart(self.likelihood.raw(parameters))[0]


def _errors(
    model: StudyModel,
    measured: Measured,
    sampled: Sampled,
    draws: tuple[Floats, Floats | None, tuple[int, int]],
    seed: Seed,
) -> ErrorDraws | None:
    """The error of the model at the draws theta (n, p) and zeta (n,), by runs."""
    erring: Erring | None = sampled.learned
    observation = measured.reference
    if sampled.effects is not None and measured.has_base:
        data = DataLikelihood(model.system, observation, modes=None)
        erring = _EffectErrors(sampled.effects, data)
    if erring is None:
        return None
    theta, zeta, shape = draws
    ratio = np.full(len(theta), model.building.damping.ratio) if zeta is None else zeta
    both = torch.from_numpy(np.column_stack([theta, ratio]))
    return draw_errors(erring, both.unflatten(0, shape), observation, seed)


def with_own_errors(posterior: Posterior, model: StudyModel, seed: Seed) -> Posterior:
    """With parameters of effects off by as much as the models of these effects may err.

    No data tell that from the parameters, so it moves the draws and not the likelihood.
    """
    own = own_errors(model.system.placed, error_of_sizes(model.building)).numpy()
    if not own.any():
        return posterior
    rng, count = np.random.default_rng(seed), model.system.factors
    neutral = np.array([one.neutral for one in model.prior.of("effect").entries])
    moved = posterior.theta.copy()
    off = 1.0 + own * rng.standard_normal((*moved.shape[:2], len(own)))
    moved[..., count:] = neutral + (moved[..., count:] - neutral) * off
    return replace(posterior, theta=np.clip(moved, posterior.lower, posterior.upper))


def draw_zeta(
    model: StudyModel,
    observation: Observation,
    theta: Floats,
    likelihood: LearnedLikelihood | None,
    seed: Seed,
) -> Floats:
    """Damping ratios (n,) for posterior draws theta (n, p).

    p(zeta | theta, x) by the data-space likelihood on a grid, averaged over some draws of theta:
    the height of the resonance peaks tells zeta almost regardless of theta.
    """
    damping = model.damping
    rng = np.random.default_rng(seed)
    some = torch.from_numpy(theta[rng.permutation(len(theta))[: CALIBRATION.zeta_samples]])
    grid = torch.linspace(damping.lower, damping.upper, CALIBRATION.zeta_grid, dtype=torch.float64)
    judge = likelihood or DataLikelihood(model.system, observation)
    both = torch.cat([some.repeat_interleave(len(grid), 0), grid.repeat(len(some))[:, None]], dim=1)
    log_density = judge(both).reshape(len(some), len(grid))
    density = torch.softmax(log_density, dim=1).mean(dim=0).numpy()
    # Within a cell of the grid zeta is uniform.
    width = (damping.upper - damping.lower) / (CALIBRATION.zeta_grid - 1)
    drawn = grid.numpy()[rng.choice(CALIBRATION.zeta_grid, size=len(theta), p=density)]
    spread = drawn + width * (rng.random(len(theta)) - 0.5)
    return np.clip(spread, damping.lower, damping.upper)


def latent_zeta(latent: FoundLatent, damping: Parameter, count: int, seed: Seed) -> Floats:
    """Damping ratios (n,) by the last coordinate of q(z|x)."""
    rng = np.random.default_rng(seed)
    found = latent.posterior
    which = rng.choice(len(found.log_weight), count, p=found.log_weight.exp().numpy())
    variance = torch.linalg.inv(found.precision)[:, -1, -1].numpy()
    z = found.mean[:, -1].numpy()[which] + np.sqrt(variance)[which] * rng.standard_normal(count)
    return damping.lower + (damping.upper - damping.lower) * ndtr(z)


def predictive_log_frf(
    system: System,
    model: StudyModel,
    posterior: Posterior,
    count: int = CALIBRATION.predictive,
    seed: int = 0,
) -> Floats:
    """ln|H| (n, f, k) of all floors at n posterior draws, measured or not.

    Of a base that was measured to turn, with what goes with its translation.
    """
    draws, zeta = posterior.thinned(count, seed)
    ratio = zeta if zeta is not None else np.full(len(draws), model.building.damping.ratio)
    theta, sizes = system.split(torch.from_numpy(np.ascontiguousarray(draws)))
    known = theta, torch.from_numpy(ratio), sizes, model.frequency_hz
    frf = system.frf(*known)
    rotation = posterior.observation.rotation
    if rotation is not None:
        frf = frf + torch.from_numpy(np.nan_to_num(rotation)) * system.turned.frf(*known)
    return np.asarray(frf.abs().clamp_min(1e-12).log().numpy())


@dataclass(frozen=True)
class Fitting:
    """How posterior draws meet the data.

    Attributes:
        misfit: smallest mean squared residual, whitened by the stated noise alone.
        check: posterior predictive p-values, with the noise and the errors that are allowed for.
        explained: share of the measured variation of ln|H| over frequency that the best draw has;
            None where no FRF was measured.
        learned: whether the likelihood allows for larger errors than the stated noise.
        wild: share of the independent points that are too far off to count.
    """

    misfit: float
    check: PredictiveCheck | None
    explained: float | None = None
    learned: bool = False
    wild: float = 0.0


def against_data(
    model: StudyModel, measured: Measured, posterior: Posterior, sampled: Sampled, seed: Seed
) -> Fitting:
    """Some posterior draws against the data."""
    observation = posterior.observation
    drawing, choosing = spawn(seed, 2)
    drawn = _some_draws(model, posterior, drawing)
    if sampled.effects is not None:
        return _against_all(model, measured, sampled.effects, drawn, choosing)
    if measured.others:
        return Fitting(*check_measured(model, measured, drawn), learned=sampled.learned is not None)
    likelihood = DataLikelihood(model.system, observation)
    residuals = likelihood.residuals(drawn)
    points = independent_share(observation) * observation.valid.sum(axis=1)
    left = residuals.square().sum(dim=1)
    if sampled.learned is None:
        allowed = with_least_noise(observation, sampled.least_noise)
        predicted = likelihood.predict(drawn[:, :-1], drawn[:, -1]).numpy()
        check = check_predictions(allowed, predicted)
    else:
        error = sampled.learned.error
        shares = torch.softmax(error.log_densities(residuals), dim=1)
        rows = torch.multinomial(shares, 1, generator=torch_generator(choosing))[:, 0]
        squares = error.floor_squares(residuals, rows)[0].numpy()
        check = predictive_check(squares, points, observation.floors)
    explained, learned = likelihood.explained(drawn), sampled.learned is not None
    return Fitting(float(left.min() / points.sum()), check, explained, learned)


def _against_all(
    model: StudyModel, measured: Measured, likelihood: EffectLikelihood, drawn: Tensor, seed: Seed
) -> Fitting:
    """Some draws (n, p) of a building with effects against all that was measured."""
    names, squares, counts = zip(*likelihood.checked(drawn, seed), strict=True)
    points = torch.stack(counts, dim=1).numpy()
    check = predictive_check(torch.stack(squares, dim=1).numpy(), points, names)
    wild = 1.0 - float(points.sum(axis=1).mean()) / max(likelihood.problem.effective, 1.0)
    explained = None
    if measured.has_base:
        explained = DataLikelihood(model.system, measured.reference).explained(drawn)
    misfit = float(likelihood.misfit(drawn).min())
    return Fitting(misfit, check, explained, learned=True, wild=wild)


def against_modes(
    model: StudyModel, measured: Measured, posterior: Posterior, seed: Seed
) -> tuple[str, ...]:
    """Every identified mode beside the posterior's, in a sentence."""
    if not measured.modes:
        return ()
    return mode_sentences(model, measured, _some_draws(model, posterior, seed))


def _some_draws(model: StudyModel, posterior: Posterior, seed: Seed) -> Tensor:
    """At most a hundred draws (n, p), the damping ratio last."""
    theta, zeta = posterior.thinned(CALIBRATION.checked, seed)
    ratio = zeta if zeta is not None else np.full(len(theta), model.building.damping.ratio)
    return torch.from_numpy(np.column_stack([theta, ratio]))


def _numpy(tensor: Tensor) -> Floats:
    return tensor.detach().cpu().to(torch.float64).numpy()
