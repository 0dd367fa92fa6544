"""Sampling by the data-space likelihood: from the latent posterior, a fit, or the prior."""

from dataclasses import replace

from torch import Tensor

from femupdate.inference.decoded_chains import DecodedPosterior, DecodedSettings
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.parameters import Parameters
from femupdate.inference.smc import TemperedSmc
from femupdate.inference.tempering import LogLikelihood
from femupdate.study import Study
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.workflow.about_maxima import FROM_FIT, Target, sampled_about_maxima
from femupdate.workflow.calibrate_effects import FittedEffects
from femupdate.workflow.calibrate_notes import cost_notes, noise_notes, reduction_warnings
from femupdate.workflow.calibrate_settings import FEW, CalibrationSettings, Sampled, drawn_by
from femupdate.workflow.decoded import sample_annealed, sample_decoded
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import (
    on_fewer_modes,
    require_own_building,
    settled_likelihood,
    smooth_likelihood,
)
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import BRIDGE, FIRST, ChainRunner
from femupdate.workflow.surrogates import find_surrogate

_FROM_LATENT, _FROM_PRIOR = "the latent", "the prior"


def sample_exact(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    run: ChainRunner,
    fitted: FittedEffects | None = None,
) -> Sampled:
    """Draw the data-space posterior by the way that suits it, which the result tells.

    Many parameters take Hamiltonian moves. A building with a surrogate starts from the solutions
    of its latent posterior, which saves most of the responses; one that lists effects starts from
    where these were `fitted`. Importance draws about the maxima that these lead to come first, and
    particles where they are not enough.
    """
    if fitted is not None:
        return _with_effects(fitted, settings, run)
    many = model.parameters.size > FEW
    if measured.beyond_surrogates:
        if many and not measured.has_base:
            # Nothing is to be learned about the maxima.
            target = Target(smooth_likelihood(model, measured), None, _FROM_PRIOR)
        else:
            target = _plain(model, measured, settings, run)
        return _sampled(target, settings, run, about=not many)
    found, latent = find_surrogate(study, model.building), None
    if found is not None and many:
        sampled = _many(found[0], model, measured, settings, run)
    else:
        if found is not None:
            latent = LatentLikelihood(found[0], model.system, measured.base, device=settings.device)
        starts = None if latent is None else latent.solutions()
        target = _plain(model, measured, settings, run, starts)
        if many:
            sampled = _by_trajectories(target, None, run)
        else:
            sampled = _sampled(target, settings, run, latent, about=latent is not None)
    notes = (*noise_notes(model, measured.base, model.least_noise), *sampled.notes)
    warnings = reduction_warnings(model, measured.base)
    return replace(sampled, notes=notes, warnings=warnings, least_noise=model.least_noise)


def _many(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Many parameters, from the latent posterior.

    What the model errs by is known from there where both believe the same noise.
    """
    drawn = sample_decoded(surrogate, model, measured, settings, run, 1)
    if model.least_noise >= surrogate.info.noise_sd:
        target = Target(on_fewer_modes(drawn.likelihood), None, _FROM_LATENT)
    else:
        states = drawn.draws.theta.flatten(0, 1)
        best = drawn.draws.log_likelihood.flatten().argsort(descending=True)
        target = _plain(model, measured, settings, run, states[best[: DecodedSettings.starts]])
    return _by_trajectories(target, drawn, run)


def _plain(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    run: ChainRunner,
    starts: Tensor | None = None,
) -> Target:
    """A building without effects, about maxima that the starts or likely points lead to."""
    seed = settings.seed if measured.has_base else run.stage(FIRST)
    found = settled_likelihood(model, measured, settings, starts, seed)
    origin = _FROM_PRIOR if starts is None else _FROM_LATENT
    return Target(on_fewer_modes(found.likelihood), found.found, origin, tried=found.tried)


def _with_effects(
    fitted: FittedEffects, settings: CalibrationSettings, run: ChainRunner
) -> Sampled:
    """A building that lists effects, about the maxima that the fit leads to.

    A frame's model serves about its fit alone, so there no particles of the prior can help.
    """
    likelihood, maxima = fitted.likelihood, fitted.maxima(settings.seed)
    points = likelihood.prior.from_normal(maxima.z)
    require_own_building(fitted.model, likelihood, points, anyway=settings.anyway)
    target = Target(likelihood, maxima, FROM_FIT, local=fitted.local)
    return _sampled(target, settings, run)


def _sampled(
    target: Target,
    settings: CalibrationSettings,
    run: ChainRunner,
    latent: LatentLikelihood | None = None,
    *,
    about: bool = True,
) -> Sampled:
    """About the maxima, if that is asked for and serves; else from the latent posterior or prior.

    Many parameters then take Hamiltonian moves.
    """
    if about:
        sampled = sampled_about_maxima(target, run.particles, run.stage(BRIDGE), run.show)
        if sampled is not None:
            return sampled
    if target.prior.size > FEW:
        return _by_trajectories(target, None, run)
    return _by_particles(target, latent, settings, run)


def _by_trajectories(target: Target, drawn: DecodedPosterior | None, run: ChainRunner) -> Sampled:
    """From the latent posterior, or from the prior, by Hamiltonian moves."""
    groups, notes = sample_annealed(target.prior, target.likelihood, run, drawn)
    way = drawn_by("exact", "Hamiltonian moves", groups)
    return Sampled(groups, target.prior, way, notes, target.likelihood)


def _on_theta(latent: LatentLikelihood, parameters: Parameters) -> LogLikelihood:
    """The latent likelihood, which knows no damping ratio, of all parameters."""

    def log_likelihood(values: Tensor) -> Tensor:
        return latent(parameters.split(values).theta)

    return log_likelihood


def _by_particles(
    target: Target,
    latent: LatentLikelihood | None,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """By particles of the latent posterior, or of the prior's, refined by importance draws."""
    prior, likelihood, smc = target.prior, target.likelihood, settings.smc
    base = None if latent is None else _on_theta(latent, prior)
    label = "data-space" if latent is None else "latent"
    sampler = TemperedSmc(prior, likelihood if base is None else base, settings=smc)
    starts = run(sampler, f"Sampling ({label} likelihood)")
    runs = run.bridge(prior, likelihood, base, starts, smc)
    notes = cost_notes(runs, starts, base is not None)
    if base is None:
        runs = [
            replace(one, evaluations=one.evaluations + start.evaluations)
            for one, start in zip(runs, starts, strict=True)
        ]
    refined = all(one.effective > 0.0 for one in runs)
    way = "importance sampling" if refined else "tempered particles"
    return Sampled(runs, prior, drawn_by("exact", way, runs), notes, likelihood)
