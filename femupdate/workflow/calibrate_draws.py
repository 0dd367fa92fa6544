"""Posterior draws with their damping ratios, and what they say of the data."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.special import ndtr
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.dynamics.excitation import Excitation
from femupdate.dynamics.system import System
from femupdate.inference.diagnostics import PredictiveCheck, predictive_check
from femupdate.inference.error_draws import ErrorDraws, draw_errors
from femupdate.inference.frf_data import FrfData
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.parameters import Parameter, own_errors
from femupdate.inference.posterior import Posterior
from femupdate.seeds import Seed, spawn
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import (
    CalibrationSettings,
    Sampled,
    data_of_modes,
    plain_settings,
)
from femupdate.workflow.model import StudyModel

_ZETA_GRID, _ZETA_SAMPLES = 25, 48  # damping ratios that are looked at, at draws of theta
_CHECKED = 100  # draws that are held against the data


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
    shape = len(sampled.runs), len(sampled.runs[0].theta)
    values = _numpy(torch.cat([run.theta for run in sampled.runs]))
    damping, erring = spawn(seed, 2)
    if not sampled.parameters.of("damping").entries:
        if not model.damping.free:
            zeta = np.full(len(values), model.damping.lower)
        elif latent is None:
            zeta = draw_zeta(model, sampled.likelihood, values, damping)
        else:
            zeta = latent_zeta(latent, model.damping, len(values), damping)
        values = np.column_stack([values, zeta])
    values = values.reshape(*shape, -1)
    return Posterior(
        parameters=model.parameters,
        values=values,
        log_likelihood=np.stack([_numpy(run.log_likelihood) for run in sampled.runs]),
        drawn=sampled.drawn,
        observation=observation,
        settings=plain_settings(settings),
        model_error=_errors(model, measured, sampled, values, erring),
    )


def with_error_of_all(posterior: Posterior, model: StudyModel, seed: Seed) -> Posterior:
    """With stiffness factors that allow for what programs differ by in all members alike.

    No data tell that from the factors, so it moves the draws and not the likelihood.
    """
    if model.shared is None:
        return posterior
    alike = np.random.default_rng(seed).standard_normal(posterior.values.shape[:2])
    moved = posterior.values.copy()
    columns = posterior.parameters.columns("stiffness")
    moved[..., columns] *= np.exp(MESH_ERROR.of_all * alike)[..., None]
    return _inside(posterior, moved)


def _inside(posterior: Posterior, values: Floats) -> Posterior:
    """The same with other draws, within the bounds."""
    known = posterior.parameters
    return replace(posterior, values=np.clip(values, known.lower.numpy(), known.upper.numpy()))


def _errors(
    model: StudyModel,
    measured: Measured,
    sampled: Sampled,
    values: Floats,
    seed: Seed,
) -> ErrorDraws | None:
    """The error of the model at draws (chains, draws, p)."""
    likelihood = sampled.likelihood
    if likelihood.base is None or not likelihood.error.parts[0].learns:
        return None
    return draw_errors(likelihood, torch.from_numpy(values), measured.reference, seed)


def with_own_errors(posterior: Posterior, model: StudyModel, seed: Seed) -> Posterior:
    """With parameters of effects off by as much as the models of these effects may err.

    No data tell that from the parameters, so it moves the draws and not the likelihood.
    """
    errors = own_errors(model.system.placed, model.building)
    if not errors.any():
        return posterior
    effects, columns = posterior.parameters.of("effect"), posterior.parameters.columns("effect")
    neutral = np.array([entry.neutral for entry in effects.entries])
    moved = posterior.values.copy()
    off = 1.0 + errors * np.random.default_rng(seed).standard_normal(
        (*moved.shape[:2], len(errors))
    )
    moved[..., columns] = neutral + (moved[..., columns] - neutral) * off
    return _inside(posterior, moved)


def draw_zeta(model: StudyModel, likelihood: Likelihood, theta: Floats, seed: Seed) -> Floats:
    """Damping ratios (n,) for posterior draws theta (n, p).

    p(zeta | theta, x) by the data-space likelihood on a grid, averaged over some draws of theta:
    the height of the resonance peaks tells zeta almost regardless of theta.
    """
    damping = model.damping
    rng = np.random.default_rng(seed)
    some = torch.from_numpy(theta[rng.permutation(len(theta))[:_ZETA_SAMPLES]])
    grid = torch.linspace(damping.lower, damping.upper, _ZETA_GRID, dtype=torch.float64)
    both = torch.cat([some.repeat_interleave(len(grid), 0), grid.repeat(len(some))[:, None]], dim=1)
    log_density = likelihood(both).reshape(len(some), len(grid))
    density = torch.softmax(log_density, dim=1).mean(dim=0).numpy()
    # Within a cell of the grid zeta is uniform.
    width = (damping.upper - damping.lower) / (_ZETA_GRID - 1)
    drawn = grid.numpy()[rng.choice(_ZETA_GRID, size=len(theta), p=density)]
    spread = drawn + width * (rng.random(len(theta)) - 0.5)
    return np.clip(spread, damping.lower, damping.upper)


def latent_zeta(latent: FoundLatent, damping: Parameter, count: int, seed: Seed) -> Floats:
    """Damping ratios (n,) by the last coordinate of q(z|x)."""
    rng = np.random.default_rng(seed)
    which = rng.choice(len(latent.log_weight), count, p=latent.log_weight.exp().numpy())
    variance = torch.linalg.inv(latent.precision)[:, -1, -1].numpy()
    z = latent.mean[:, -1].numpy()[which] + np.sqrt(variance)[which] * rng.standard_normal(count)
    return damping.lower + (damping.upper - damping.lower) * ndtr(z)


def predictive_log_frf(
    system: System,
    model: StudyModel,
    posterior: Posterior,
    count: int = 200,
    seed: int = 0,
) -> Floats:
    """ln|H| (n, f, k) of all floors at n posterior draws, measured or not.

    Of a base that was measured to turn, with what goes with its translation.
    """
    drawn = posterior.parameters.split(posterior.thinned(count, seed))
    known = drawn.theta, drawn.zeta, drawn.sizes, model.frequency_hz
    frf = system.frf(*known)
    rotation = posterior.observation.rotation
    if rotation is not None:
        frf, turned = system.respond(Excitation(turns=True), *known).unbind(dim=2)
        frf = frf + torch.from_numpy(np.nan_to_num(rotation)) * turned
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
        errors: sentences on errors of the model under forces.
    """

    misfit: float
    check: PredictiveCheck | None
    explained: float | None = None
    learned: bool = False
    wild: float = 0.0
    errors: tuple[str, ...] = ()


def against_data(
    model: StudyModel, measured: Measured, posterior: Posterior, sampled: Sampled, seed: Seed
) -> Fitting:
    """Some posterior draws against the data."""
    drawing, choosing = spawn(seed, 2)
    drawn, likelihood = posterior.thinned(_CHECKED, drawing), sampled.likelihood
    names, squares, counts = zip(*likelihood.checked(drawn, choosing), strict=True)
    points = torch.stack(counts, dim=1).numpy()
    check = predictive_check(torch.stack(squares, dim=1).numpy(), points, names)
    wild = 1.0 - float(points.sum(axis=1).mean()) / max(likelihood.effective, 1.0)
    misfit = float(likelihood.misfit(drawn).min())
    errors, residuals = [], likelihood.error.apart(likelihood.raw(drawn))
    for data, error, misses in zip(likelihood.data, likelihood.error.parts, residuals, strict=True):
        if isinstance(data, FrfData) and data.forced and error.learns:
            density = error.log_densities(misses)
            at = int(density.logsumexp(1).argmax())
            left = data.remains(error, int(density[at].argmax()), misses[at])
            errors.append(f"{left.sentence} The intervals allow for it." if left.size else "")
    told = tuple(filter(None, errors))
    return Fitting(misfit, check, likelihood.explained(drawn), likelihood.learns, wild, told)


def against_modes(
    model: StudyModel, measured: Measured, posterior: Posterior, seed: Seed
) -> tuple[str, ...]:
    """Every identified mode beside the posterior's, in a sentence."""
    drawn = posterior.parameters.split(posterior.thinned(_CHECKED, seed))
    told = []
    for modes, data in zip(measured.modes, data_of_modes(measured, model.system), strict=True):
        found = data.paired(data.predicted(model.system, drawn.theta, drawn.zeta, drawn.sizes))
        frequency = found[:, :, 0].exp().numpy() / (2.0 * np.pi)
        product = (data.shape_root**2 * data.shape * found[:, :, 2:]).sum(2)
        mac = (product / (data.shape_root * data.shape).square().sum(1)).mean(0).numpy()
        for k, name in enumerate(modes.names):
            draws = frequency[:, k]
            shape = "" if np.isnan(mac[k]) else f", MAC {mac[k]:.3f}"
            told.append(
                f"Mode {name} at {modes.frequency_hz[k]:.4g} Hz: the posterior has"
                f" {draws.mean():.4g} ± {draws.std():.2g} Hz{shape}."
            )
    return tuple(told)


def _numpy(tensor: Tensor) -> Floats:
    return tensor.detach().to(torch.float64).numpy()
