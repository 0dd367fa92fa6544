"""Sampling by the data-space likelihood: from the latent posterior, or from the prior."""

from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from femupdate.inference.bridge import as_smc_result
from femupdate.inference.importance import Counted, WeightedDraws
from femupdate.inference.joint import JointLikelihood, Kind
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.learned import LearnedLikelihood, Settled, settled
from femupdate.inference.likelihood import DataLikelihood
from femupdate.inference.maxima import draws_about, found_from
from femupdate.inference.parameters import Parameters
from femupdate.inference.prior_search import best_of_prior
from femupdate.inference.smc import SmcResult, TemperedSmc
from femupdate.inference.tempering import LogLikelihood
from femupdate.seeds import spawn
from femupdate.study import Study
from femupdate.surrogate.gauss_newton import Descent
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.units import percent
from femupdate.workflow.calibrate_notes import cost_notes, reduction_warnings, require_own_building
from femupdate.workflow.calibrate_settings import (
    CalibrationSettings,
    Sampled,
    by_importance,
    by_runs,
)
from femupdate.workflow.decoded import sample_annealed, sample_decoded
from femupdate.workflow.kinds import Measured, likelihoods_of_others
from femupdate.workflow.model import StudyModel
from femupdate.workflow.sampling import BRIDGE, FIRST, ChainRunner
from femupdate.workflow.surrogates import find_surrogate
from femupdate.workflow.thresholds import CALIBRATION


@dataclass(frozen=True)
class _Problem:
    """What is sampled, with zeta as one more parameter where it is a nuisance."""

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
        require_own_building(self.model, found, anyway=self.settings.anyway)
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
) -> Sampled:
    """Draw the data-space posterior by the way that suits it, which the result tells.

    Many parameters take Hamiltonian moves. A building with a surrogate starts from the solutions
    of its latent posterior, which saves most of the responses; importance draws about the maxima
    that these lead to come first, and particles where they are not enough.
    """
    problem = _Problem(model, measured, settings)
    if measured.beyond_surrogates:
        return _of_any_kind(problem, run)
    observation = measured.base
    found = find_surrogate(study, model.building)
    if problem.prior.size > CALIBRATION.few:
        sampled = _by_trajectories(problem, found, run)
    elif found is None:
        sampled = _by_particles(problem, None, run)
    else:
        latent = LatentLikelihood(found[0], model.system, observation, device=settings.device)
        problem = replace(problem, starts=latent.solutions())
        sampled = _about_maxima(problem, run) or _by_particles(problem, latent, run)
    return replace(
        sampled,
        learned=problem.learned,
        warnings=reduction_warnings(model, observation),
    )


def _of_any_kind(problem: _Problem, run: ChainRunner) -> Sampled:
    """Without a surrogate: about maxima that the most likely points of the prior lead to."""
    if problem.prior.size > CALIBRATION.few:
        return _by_trajectories(problem, None, run)
    tried = 0
    if not problem.measured.has_base:
        starts, tried = best_of_prior(problem.prior, problem.target, run.stage(FIRST))
        problem = replace(problem, starts=starts)
    sampled = _about_maxima(problem, run, tried) or _by_particles(problem, None, run)
    return replace(sampled, learned=problem.learned) if problem.measured.has_base else sampled


def _by_trajectories(
    problem: _Problem, found: tuple[TrainedSurrogate, object] | None, run: ChainRunner
) -> Sampled:
    """From the latent posterior, or from the prior, by Hamiltonian moves."""
    drawn = None
    if found is not None:
        base, settings = problem.measured.base, problem.settings
        drawn = sample_decoded(found[0], problem.model, base, settings, run, 1)
    groups, notes = sample_annealed(problem.prior, problem.target, run, drawn)
    return Sampled(
        groups, problem.prior, by_runs("exact", "Hamiltonian moves", groups, evidence=True), notes
    )


def _about_maxima(problem: _Problem, run: ChainRunner, tried: int = 0) -> Sampled | None:
    """By importance draws about the maxima; None where too few of them count.

    `tried` points of the prior have been judged to find the starts, unless they are latent draws.
    """
    # Rounds of fitting take some hundred draws a parameter.
    expected = run.particles + 200 * problem.prior.size
    run.show.start("Importance sampling (data-space likelihood)", expected)
    drawing, choosing = spawn(run.stage(BRIDGE), 2)
    counted = Counted(problem.target, run.show)
    found = draws_about(problem.prior, counted, problem.maxima, run.particles, drawing)
    if found is None:
        return None
    theta, value = found.resample(run.particles, choosing)
    result = SmcResult(theta, value, found.log_evidence, (), found.evaluations, 0)
    found = replace(found, evaluations=found.evaluations + tried)
    origin = "prior" if tried else "latent"
    drawn = by_importance("importance sampling about the maxima", [found])
    return Sampled([result], problem.prior, drawn, (_maxima_note(found, origin),))


def _maxima_note(found: WeightedDraws, origin: str) -> str:
    return (
        f"From the {origin} to the data-space posterior took {found.evaluations:,} responses; "
        f"{percent(found.effective / len(found.points))} of the importance draws are effective."
    )


def _on_theta(latent: LatentLikelihood, parameters: Parameters) -> LogLikelihood:
    """The latent likelihood, which knows no damping ratio, of all parameters."""

    def log_likelihood(values: Tensor) -> Tensor:
        return latent(parameters.split(values).theta)

    return log_likelihood


def _by_particles(problem: _Problem, latent: LatentLikelihood | None, run: ChainRunner) -> Sampled:
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
