"""What is concluded from posterior draws, however they were drawn, and what is told of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from scipy.special import chdtrc, ndtr
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.strength import what_yields
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.effects.tolerances import TOLERANCES, key_of
from femupdate.errors import InferenceError
from femupdate.inference.diagnostics import MISSED, PredictiveCheck, predictive_check
from femupdate.inference.error_draws import draw_errors
from femupdate.inference.event_scatter import LearnedScatter, learned_scatter
from femupdate.inference.frf_data import FrfData, base_logs
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.likelihood import Likelihood, missed
from femupdate.inference.model_error import WILD
from femupdate.inference.parameters import Parameter, own_errors
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, spawn
from femupdate.surrogate.storage import ANY_FLOORS, SurrogateInfo
from femupdate.units import listed, percent
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import (
    LEAST_EXPLAINED,
    CalibrationSettings,
    Sampled,
    beyond_prior,
    data_of_modes,
    plain_settings,
)
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import direction_of

_ZETA_GRID, _ZETA_SAMPLES = 16, 24  # damping ratios that are looked at, at draws of theta
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
    runs, likelihood, errors = sampled.runs, sampled.likelihood, None
    shape = len(runs), len(runs[0].theta)
    values = torch.cat([run.theta for run in runs]).detach().double().numpy()
    damping, erring = spawn(seed, 2)
    if not sampled.parameters.of("damping").entries:
        if not model.damping.free:
            zeta = np.full(len(values), model.damping.lower)
        elif latent is None:
            zeta = draw_zeta(model, likelihood, values, damping)
        else:
            zeta = latent_zeta(latent, model.damping, len(values), damping)
        values = np.column_stack([values, zeta])
    values = values.reshape(*shape, -1)
    if likelihood.base is not None and likelihood.error.parts[0].learns:
        errors = draw_errors(likelihood, torch.from_numpy(values), measured.reference, erring)
    density = torch.stack([run.log_likelihood for run in runs])
    return Posterior(
        parameters=model.parameters,
        values=values,
        log_likelihood=density.detach().double().numpy(),
        drawn=sampled.drawn,
        observation=measured.as_observation,
        settings=plain_settings(settings),
        model_error=errors,
    )


def with_errors_of_models(posterior: Posterior, model: StudyModel, seed: Seed) -> Posterior:
    """With draws that allow for what no data tell from them; their likelihood stays.

    Stiffness factors allow for what programs differ by in all members alike, parameters of effects
    for what the models of these effects err by.
    """
    known, moved = posterior.parameters, posterior.values.copy()
    shape, of_effects = moved.shape[:2], spawn(seed, 1)[0]
    if model.shared is not None:
        alike = np.random.default_rng(seed).standard_normal(shape)
        moved[..., known.columns("stiffness")] *= np.exp(MESH_ERROR.of_all * alike)[..., None]
    errors = own_errors(model.system.placed, model.building)
    if errors.any():
        columns = known.columns("effect")
        neutral = np.array([entry.neutral for entry in known.of("effect").entries])
        off = errors * np.random.default_rng(of_effects).standard_normal((*shape, len(errors)))
        moved[..., columns] += (moved[..., columns] - neutral) * off
    return replace(posterior, values=np.clip(moved, known.lower.numpy(), known.upper.numpy()))


def draw_zeta(model: StudyModel, likelihood: Likelihood, theta: Floats, seed: Seed) -> Floats:
    """Damping ratios (n,) for posterior draws theta (n, p).

    p(zeta | theta, x) by the data-space likelihood on a grid, averaged over some draws of theta:
    the height of the resonance peaks tells zeta almost regardless of theta. A grid of whose cells
    fewer than six count becomes one of these.
    """
    damping = model.damping
    low, high = damping.lower, damping.upper
    rng = np.random.default_rng(seed)
    some = torch.from_numpy(theta[rng.permutation(len(theta))[:_ZETA_SAMPLES]])
    for _ in range(6):
        grid = torch.linspace(low, high, _ZETA_GRID, dtype=torch.float64)
        beside = grid.repeat(len(some))[:, None]
        both = torch.cat([some.repeat_interleave(len(grid), 0), beside], dim=1)
        log_density = likelihood(both).reshape(len(some), len(grid))
        density = torch.softmax(log_density, dim=1).mean(dim=0).numpy()
        counted = np.flatnonzero(density > 1e-3 * density.max())
        if counted[-1] - counted[0] >= 5:
            break
        low = float(grid[max(counted[0] - 1, 0)])
        high = float(grid[min(counted[-1] + 1, _ZETA_GRID - 1)])
    # Within a cell of the grid zeta is uniform.
    width = float(grid[1] - grid[0])
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


def against_data(posterior: Posterior, sampled: Sampled, seed: Seed) -> Fitting:
    """Some posterior draws against the data."""
    drawing, choosing = spawn(seed, 2)
    likelihood = sampled.likelihood
    raw = likelihood.raw(posterior.thinned(_CHECKED, drawing))
    names, squares, counts = zip(*likelihood.checked(raw, choosing), strict=True)
    points = torch.stack(counts, dim=1).numpy()
    check = predictive_check(torch.stack(squares, dim=1).numpy(), points, names)
    wild = 1.0 - float(points.sum(axis=1).mean()) / max(likelihood.effective, 1.0)
    misfit = float(likelihood.misfit(raw).min())
    errors, residuals = [], likelihood.error.apart(raw)
    for data, error, misses in zip(likelihood.data, likelihood.error.parts, residuals, strict=True):
        if isinstance(data, FrfData) and data.forced and error.learns:
            density = error.log_densities(misses)
            at = int(density.logsumexp(1).argmax())
            left = data.remains(error, int(density[at].argmax()), misses[at])
            allowed = "The intervals allow for what shows, not for what factors took up."
            errors.append(f"{left.sentence} {allowed}" if left.size else "")
    told = tuple(filter(None, errors))
    return Fitting(misfit, check, likelihood.explained(raw), likelihood.learns, wild, told)


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


def mesh_warnings(likelihood: Likelihood) -> tuple[str, ...]:
    """Whether the errors of a mesh are taken for far larger than they are known to be."""
    known = likelihood.known
    if known is None or chdtrc(len(known.likeliest), float(known.likeliest.square().sum())) > 1e-3:
        return ()
    return (
        "The data are met only if the mesh errs far more than it was seen to: the model lacks "
        "something that `diagnose` may find, or needs a smaller mesh.size. Do not trust these "
        "intervals.",
    )


def calibration_notes(info: SurrogateInfo, observation: Observation) -> tuple[str, ...]:
    """How often posteriors of the surrogate contained the truth in simulations."""
    notes, floors = [], observation.floors
    kept = info.calibration
    if kept:
        notes.append(
            f"In {kept['cases']} simulations the 90 % region contained "
            f"{percent(kept['coverage_90_before'])} of the truths."
        )
    if kept and kept["floors"] != [ANY_FLOORS] and set(floors) != set(kept["floors"]):
        notes.append(
            f"That was checked for {', '.join(kept['floors'])}, not for {', '.join(floors)}; "
            "--exact needs no such check."
        )
    return tuple(notes)


def judgement(posterior: Posterior, fitting: Fitting) -> tuple[str, ...]:
    """What decides whether a posterior can be used, the decisive first."""
    notes, check = [], fitting.check
    if fitting.explained is not None and fitting.explained < LEAST_EXPLAINED:
        notes.append(
            "The observation is unlike anything that this building can do: do not trust this."
        )
    missed = fitting.misfit > 2.0
    if missed:
        what = "the measured ln|H|" if posterior.observation.valid.any() else "what was measured"
        allowed = (
            "the intervals allow for what shows, not for what factors took up"
            if fitting.learned
            else "the standard deviations are too small by about that factor"
        )
        notes.append(
            f"The model misses {what} by {fitting.misfit**0.5:.1f} times its noise (rms, best "
            f"draw): something is missing in the model; {allowed}."
        )
    if wild := fitting.wild > 0.005:
        notes.append(
            f"{percent(fitting.wild, 1)} of the points are farther off than {WILD:g} "
            "standard deviations of noise and model error together: they count no more, neither "
            "for the parameters nor in the p-value."
        )
    # Where no error was learned, the first note says so already. A p-value alone, of data that
    # miss hardly more than is allowed for, is no warning.
    new = fitting.learned or not (missed or wild)
    if new and check is not None:
        over = check.ratios[0] ** 0.5
        if at := listed(check.missed):
            at, over = f" at {at}", max(check.ratios[1:]) ** 0.5
        if at or (check.whole < 0.01 and over > MISSED):
            notes.append(
                f"The data miss the model{at} by {over:.2g} times what is allowed for (noise and "
                "error of the model, rms): intervals are too narrow by about that factor."
            )
    notes += _at_limits(posterior)
    worst = posterior.r_hat
    if worst is not None and worst.max() > 1.05:
        notes.append(
            f"The independent runs differ (r-hat up to {worst.max():.2f}): use more particles."
        )
    return tuple(notes)


def changing(model: StudyModel, measured: Measured, posterior: Posterior) -> tuple[str, ...]:
    """What the run shows that no linear structure does, where it has one place."""
    if measured.run is None:
        return ()
    mean = posterior.parameters.split(torch.from_numpy(posterior.values.mean(axis=(0, 1))[None]))
    building, top_hz = model.building, float(model.frequency_hz[-1])
    sample = mean.theta, mean.zeta, mean.sizes
    along = direction_of(building)
    text = what_yields(measured.run, along, building, model.system, sample, top_hz)[0]
    told = "The factors are those of its mean strength, and serve motions of that strength."
    return (f"{text} {told}",) if text else ()


def tolerance_notes(posterior: Posterior) -> tuple[str, ...]:
    """How much of the factors' intervals comes from what is known to a tolerance alone.

    Shares of variance by linear regression on the draws of each tolerance's parameters.
    """
    keys = np.array([key_of(name) for name in posterior.names])
    draws = posterior.samples - posterior.samples.mean(axis=0)
    factors = draws[:, : posterior.of("stiffness").samples.shape[1]]
    told = []
    for key, words in TOLERANCES.items():
        known = draws[:, keys == key]
        if known.size:
            fitted = known @ np.linalg.lstsq(known, factors, rcond=None)[0]
            shares = fitted.var(axis=0) / factors.var(axis=0)
            told.append(f"that of {words} {', '.join(percent(share) for share in shares)}")
    if not told:
        return ()
    return (f"Of the variances of the factors, by tolerances: {'; '.join(told)}.",)


def overstated_noise(fitting: Fitting, assumed: bool = False) -> tuple[str, ...]:
    """Where the model meets the data far better than their noise, stated or assumed, allows."""
    rms = fitting.misfit**0.5
    if not rms < 0.5:
        return ()
    noise = "the noise assumed for them" if assumed else "their stated noise"
    return (
        f"The best draw misses the data by {rms:.2g} times {noise} (rms): that noise is "
        f"{'too large' if assumed else 'overstated'}, and these intervals are wide rather than "
        "narrow.",
    )


def _at_limits(posterior: Posterior) -> list[str]:
    """Parameters that press against the limits of their prior, damping ratios too."""
    told = []
    for end in ("lower", "upper"):
        named, keys = [], []
        for at, entry in enumerate(posterior.parameters.entries):
            away = np.abs(posterior.values[..., at] - getattr(entry, end))
            # Three of ten draws within a fiftieth of the prior.
            if entry.free and (away < 0.02 * (entry.upper - entry.lower)).mean() > 0.3:
                named.append(f"{entry.called} ({getattr(entry, end):.3g})")
                keys += [entry.key] if entry.key else []
        if named:
            where = f" by {end} of {' and '.join(dict.fromkeys(keys))}" if keys else ""
            told.append(
                f"{', '.join(named)} press{'es' if len(named) == 1 else ''} against the prior's "
                f"{end} limit: widen the prior{where}, or look for what is missing in the model."
            )
    return told


def concluded(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    sampled: Sampled,
    seeds: Sequence[Seed],
    path: Path,
) -> CalibrationReport:
    """The posterior, beside the data, and what is to be said of it; nothing is written yet.

    Args:
        model: with the effects that the building lists.
        seeds: of damping ratios, checks, scatter between runs, and what all members err by.

    Raises:
        InferenceError: factors outside of the prior meet the data far better than all inside.
    """
    damping, checking, between, erring = seeds
    latent = None if model.shared is None else sampled.latent
    posterior = posterior_of(model, measured, settings, sampled, latent, damping)
    fitting = against_data(posterior, sampled, checking)
    learned = None if model.finer is None else model.finer.error
    warnings = (
        *changing(model, measured, posterior),
        *([learned.too_coarse] if learned and learned.too_coarse else []),
        *measured.left_out,
        *measured.doubts,
        *sampled.warnings,
        *mesh_warnings(sampled.likelihood),
        *judgement(posterior, fitting),
    )
    error = posterior.model_error
    # Beside an error of .4 in ln|H| no interval of a per cent means anything.
    far = error is not None and error.amplitude.size > 0.4
    if fitting.misfit > 4.0 and (far or _at_limits(posterior)):
        best = torch.from_numpy(posterior.values.reshape(-1, posterior.values.shape[-1]))
        best = best[[int(posterior.log_likelihood.argmax())]]
        outside = beyond_prior(model, measured, best, settings)
        if not settings.anyway and any("[prior.theta" in told for told in outside):
            raise InferenceError(f"{outside[0]} --anyway keeps draws that do not hold this answer.")
        warnings = (*outside, *warnings)
    scatter = scatter_of_runs(model, measured.runs, posterior, between)
    posterior = replace(posterior, warnings=warnings, scatter=scatter)
    posterior = with_errors_of_models(posterior, model, erring)
    # The decisive come first.
    notes = (
        *warnings,
        *(() if error is None else (error.sentence(posterior.observation),)),
        *fitting.errors,
        *tolerance_notes(posterior),
        *overstated_noise(fitting, measured.assumes_noise),
        *(() if scatter is None else (scatter.sentence(),)),
        *posterior.identified.sentences(),
        *against_modes(model, measured, posterior, checking),
        *measured.notes,
        *sampled.notes,
    )
    return CalibrationReport(
        model=model,
        posterior=posterior,
        path=path,
        misfit=fitting.misfit,
        check=fitting.check,
        notes=notes,
        seconds=0.0,
        invalid=sum(run.invalid for run in sampled.runs),
        files=(),
        details=sampled.notes,
    )


def scatter_of_runs(
    model: StudyModel, runs: Sequence[Observation], posterior: Posterior, seed: Seed
) -> LearnedScatter | None:
    """How much stiffness and damping differ between runs; None of a single one.

    Each run moves the stiffness factors of the posterior's mean together, and its damping, by a
    likelihood of its own, in which the model may err.

    Args:
        runs: FRFs under base motion, each at its level.
    """
    if len(runs) < 2:
        return None
    found = np.array([_moments(model, run, posterior) for run in runs])
    return learned_scatter(found[:, 0], found[:, 1], posterior.values.shape[:2], seed)


def _moments(model: StudyModel, run: Observation, posterior: Posterior) -> Floats:
    """Mean and standard deviation (2, 2) of ln stiffness and ln damping over the posterior's."""
    data, parameters = base_logs(run, model.system), posterior.parameters
    # Errors of the model that all runs share, such as a mesh's, do not move one from another.
    error = data.error(None)
    mean = parameters.split(torch.from_numpy(posterior.values.mean(axis=(0, 1))[None]))
    theta, zeta = model.system.at_level(mean.theta, mean.zeta, mean.sizes, run.level)

    def judge(moved: Tensor) -> Tensor:
        factors = theta * moved[:, :1].exp()
        damped = (zeta * moved[:, 1:].exp()).clamp_max(0.99)
        known = factors, damped[:, 0], mean.sizes.expand(len(moved), -1)
        left = missed((data,), model.system, known)
        # A row that is unlikely where least is left is so everywhere.
        best = left.square().sum(1).argsort()[:9]
        rows = error.counting(error.log_densities(left[best]))
        return torch.logsumexp(error.kept(rows).log_densities(left), dim=1)

    # Four grids of 17 points each way, of ln, each about what the one before found. A damping ratio
    # that is known stays, and its deviation is infinite.
    damping = parameters.of("damping").size > 0
    centre, half = np.zeros(2), np.array([0.4, 1.5 * damping])
    centred, sd = centre, half
    for _ in range(4):
        axes = [np.linspace(c - h, c + h, 17) for c, h in zip(centre, half, strict=True)]
        points = np.stack(np.meshgrid(*(axes if damping else (axes[0], [0.0]))), axis=-1)
        points = points.reshape(-1, 2)
        weight = torch.softmax(judge(torch.from_numpy(points)), dim=0).numpy()
        centred = weight @ points
        sd = np.sqrt(weight @ (points - centred) ** 2)
        cell = half / 8.0
        centre, half = centred, np.minimum(half, np.maximum(4.0 * sd, 2.0 * cell))
    return np.array([centred, np.where([True, damping], sd, np.inf)])
