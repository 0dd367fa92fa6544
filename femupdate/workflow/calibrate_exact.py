"""Sampling by the data-space likelihood: from the latent posterior, a fit, or the prior."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.bridge import as_smc_result
from femupdate.inference.decoded_chains import DecodedPosterior
from femupdate.inference.importance import Counted
from femupdate.inference.joint import JointLikelihood, Kind
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.learned import LearnedLikelihood, Settled, settled
from femupdate.inference.likelihood import DataLikelihood
from femupdate.inference.maxima import draws_about, found_from
from femupdate.inference.parameters import Parameters
from femupdate.inference.prior_search import best_of_prior
from femupdate.inference.smc import TemperedSmc
from femupdate.inference.tempering import LogLikelihood
from femupdate.inference.thresholds import MAXIMA
from femupdate.seeds import spawn
from femupdate.study import Study
from femupdate.surrogate.gauss_newton import Descent
from femupdate.units import percent
from femupdate.workflow.calibrate_effects import FittedEffects
from femupdate.workflow.calibrate_notes import cost_notes, reduction_warnings, require_own_building
from femupdate.workflow.calibrate_settings import (
    CalibrationSettings,
    Sampled,
    about_maxima,
    by_importance,
    by_runs,
)
from femupdate.workflow.decoded import sample_annealed, sample_decoded
from femupdate.workflow.kinds import Measured, likelihoods_of_others
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import BRIDGE, FIRST, ChainRunner
from femupdate.workflow.surrogates import find_surrogate
from femupdate.workflow.thresholds import CALIBRATION

_FROM_LATENT, _FROM_PRIOR, _FROM_FIT = "the latent", "the prior", "the fit"


class _Target(Protocol):
    """What is sampled."""

    @property
    def settings(self) -> CalibrationSettings:
        """How."""
        ...

    @property
    def prior(self) -> Parameters:
        """Of all parameters, with zeta as one more where it is a nuisance."""
        ...

    @property
    def target(self) -> Kind:
        """The likelihood of all that was measured."""
        ...

    @property
    def maxima(self) -> Descent:
        """Of the posterior, in standard normal coordinates."""
        ...


@dataclass(frozen=True)
class _WithEffects:
    """A building that lists effects: one likelihood of all kinds, highest where it was fitted."""

    fitted: FittedEffects
    settings: CalibrationSettings

    @property
    def prior(self) -> Parameters:
        """Of stiffness factors, effects and damping."""
        return self.fitted.likelihood.prior

    @property
    def target(self) -> Kind:
        """The likelihood of all that was measured."""
        return self.fitted.likelihood

    @cached_property
    def maxima(self) -> Descent:
        """Of the posterior, in standard normal coordinates."""
        return self.fitted.maxima(self.settings.seed)


@dataclass(frozen=True)
class _Problem:
    """A building without effects, with zeta as one more parameter where it is a nuisance."""

    model: StudyModel
    measured: Measured
    settings: CalibrationSettings
    starts: Tensor | None = None

    @property
    def prior(self) -> Parameters:
        """Of all parameters."""
        return self.model.parameters

    @cached_property
    def settled(self) -> Settled:
        """The highest likelihoods, and errors of the model that count there."""
        found = settled(
            self.prior,
            self.model.system,
            self.measured.base,
            self.settings.seed,
            starts=self.starts,
            device=self.settings.device,
            shared=self.model.shared,
            others=self.others,
        )
        require_own_building(
            self.model, found.likelihood.data, found.found, anyway=self.settings.anyway
        )
        return found

    @property
    def others(self) -> tuple[Kind, ...]:
        """Likelihoods of what is no FRF under base motion."""
        return likelihoods_of_others(self.model, self.measured)

    @cached_property
    def learned(self) -> LearnedLikelihood:
        """The likelihood, with the errors that count."""
        data = DataLikelihood(
            self.model.system,
            self.measured.base,
            device=self.settings.device,
            precision=torch.float32,
        )
        return replace(self.settled.likelihood, data=data)

    @property
    def maxima(self) -> Descent:
        """Of the likelihood of all that was measured, in standard normal coordinates."""
        if self.measured.has_base:
            return self.settled.found
        assert self.starts is not None
        return found_from(self.prior, self.target.residuals, self.starts)

    @cached_property
    def target(self) -> Kind:
        """The likelihood of all that was measured."""
        return self.learned if self.measured.has_base else JointLikelihood(self.others)


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
        return _with_effects(fitted, measured, settings, run)
    problem = _Problem(model, measured, settings)
    if measured.beyond_surrogates:
        return _of_any_kind(problem, run)
    observation = measured.base
    found = find_surrogate(study, model.building)
    if problem.prior.size > CALIBRATION.few:
        drawn = found and sample_decoded(found[0], model, observation, settings, run, 1)
        sampled = _by_trajectories(problem, drawn, run)
    elif found is None:
        sampled = _by_particles(problem, None, run)
    else:
        latent = LatentLikelihood(found[0], model.system, observation, device=settings.device)
        problem = replace(problem, starts=latent.solutions())
        about = _about_maxima(problem, run, _FROM_LATENT)
        sampled = about or _by_particles(problem, latent, run)
    return replace(
        sampled,
        learned=problem.learned,
        warnings=reduction_warnings(model, observation),
    )


def _with_effects(
    fitted: FittedEffects, measured: Measured, settings: CalibrationSettings, run: ChainRunner
) -> Sampled:
    """About the maxima that the fit leads to.

    A frame's model serves about its fit alone, so there no particles of the prior can help.
    """
    model, problem = fitted.model, _WithEffects(fitted, settings)
    if measured.has_base:
        data = DataLikelihood(model.system, measured.reference, modes=None)
        require_own_building(model, data, problem.maxima, anyway=settings.anyway)
    sampled = _about_maxima(problem, run, _FROM_FIT, local=fitted.local)
    if sampled is None and problem.prior.size > CALIBRATION.few:
        sampled = _by_trajectories(problem, None, run)
    sampled = sampled or _by_particles(problem, None, run)
    return replace(sampled, effects=fitted.likelihood)


def _of_any_kind(problem: _Problem, run: ChainRunner) -> Sampled:
    """Without a surrogate: about maxima that the most likely points of the prior lead to."""
    if problem.prior.size > CALIBRATION.few:
        return _by_trajectories(problem, None, run)
    tried = 0
    if not problem.measured.has_base:
        starts, tried = best_of_prior(problem.prior, problem.target, run.stage(FIRST))
        problem = replace(problem, starts=starts)
    about = _about_maxima(problem, run, _FROM_PRIOR, tried)
    sampled = about or _by_particles(problem, None, run)
    return replace(sampled, learned=problem.learned) if problem.measured.has_base else sampled


def _by_trajectories(problem: _Target, drawn: DecodedPosterior | None, run: ChainRunner) -> Sampled:
    """From the latent posterior, or from the prior, by Hamiltonian moves."""
    groups, notes = sample_annealed(problem.prior, problem.target, run, drawn)
    return Sampled(
        groups, problem.prior, by_runs("exact", "Hamiltonian moves", groups, evidence=True), notes
    )


def _about_maxima(
    problem: _Target, run: ChainRunner, origin: str, tried: int = 0, *, local: bool = False
) -> Sampled | None:
    """By importance draws about the maxima; None where too few of them count.

    `tried` points of the prior have been judged to find the starts. Of a `local` model they are
    all that there is, however few of them count.
    """
    # Rounds of fitting take some hundred draws a parameter.
    expected = run.particles + 200 * problem.prior.size
    run.show.start("Importance sampling (data-space likelihood)", expected)
    drawing, choosing = spawn(run.stage(BRIDGE), 2)
    counted, least = Counted(problem.target, run.show), 0.0 if local else MAXIMA.trusted
    found = draws_about(problem.prior, counted, problem.maxima, run.particles, drawing, least)
    if found is None:
        if local:
            raise InferenceError("no draw about the fit is possible; the data say too little")
        return None
    found = replace(found, evaluations=found.evaluations + tried)
    share = found.effective / len(found.points)
    note = (
        f"From {origin} to the data-space posterior took {found.evaluations:,} responses; "
        f"{percent(share)} of the importance draws are effective."
    )
    return about_maxima(problem.prior, found, run.particles, choosing, note)


def _on_theta(latent: LatentLikelihood, parameters: Parameters) -> LogLikelihood:
    """The latent likelihood, which knows no damping ratio, of all parameters."""

    def log_likelihood(values: Tensor) -> Tensor:
        return latent(parameters.split(values).theta)

    return log_likelihood


def _by_particles(problem: _Target, latent: LatentLikelihood | None, run: ChainRunner) -> Sampled:
    """By particles of the latent posterior, or of the prior's, refined by importance draws."""
    prior, smc = problem.prior, problem.settings.smc
    base = None if latent is None else _on_theta(latent, prior)
    label = "data-space" if latent is None else "latent"
    sampler = TemperedSmc(prior, problem.target if base is None else base, settings=smc)
    starts = run(sampler, f"Sampling ({label} likelihood)")
    results = run.bridge(prior, problem.target, base, starts, smc)
    if base is None:
        results = [
            replace(result, evaluations=result.evaluations + start.evaluations)
            for result, start in zip(results, starts, strict=True)
        ]
    draws = [as_smc_result(result, start) for result, start in zip(results, starts, strict=True)]
    refined = all(result.effective > 0.0 for result in results)
    return Sampled(
        draws,
        prior,
        by_importance("importance sampling", results)
        if refined
        else by_runs("exact", "tempered particles", draws, evidence=True),
        cost_notes(results, starts, base is not None),
    )
