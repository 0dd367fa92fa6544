"""From a likelihood, and effects that the file lists, to draws: about maxima, else by particles."""

import math
import time
from dataclasses import dataclass, replace
from functools import partial

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, parameters_at
from femupdate.discrepancy.mesh_error import MeshError, left_open
from femupdate.discrepancy.search import prepared, refined
from femupdate.effects.registry import building_effects
from femupdate.errors import InferenceError
from femupdate.inference.importance import Counted, SamplerRun, draws_about_particles
from femupdate.inference.latent_likelihood import LatentLikelihood
from femupdate.inference.likelihood import Data, Likelihood
from femupdate.inference.maxima import (
    FEW,
    coarse_maxima,
    draws_about,
    on_fewer_shapes,
    wide_start,
)
from femupdate.inference.model_error import COARSE_ERROR
from femupdate.inference.parameters import Parameters, effect_parameters
from femupdate.inference.smc import Hamiltonian, LogLikelihood, SmcSettings, TemperedSmc
from femupdate.maximise import Descent
from femupdate.progress import SILENT, Percent, Progress, waiting
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.study import Study
from femupdate.surrogate.storage import find_surrogate, require_surrogate
from femupdate.units import percent
from femupdate.workflow.conclusion import calibration_notes
from femupdate.workflow.diagnose import finder_model
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import (
    CalibrationSettings,
    Sampled,
    base_data,
    data_of_forces,
    data_of_modes,
    drawn_by,
    on_fewer_modes,
    settled_likelihood,
    smooth_likelihood,
)
from femupdate.workflow.model import StudyModel


@dataclass(frozen=True, eq=False)
class FittedEffects:
    """A model with effects, fitted to what was measured.

    Attributes:
        model: with its effects; of a frame on a basis about the fit.
        start: (1, p) parameters at the fit.
        local: whether the model serves about the fit alone.
    """

    model: StudyModel
    start: Tensor
    local: bool

    def starts(self, likelihood: Likelihood, seed: Seed) -> Tensor:
        """Parameters (s, p), one at least near every maximum of a likelihood.

        Where the model serves the whole prior, its likely points lead to other solutions.
        """
        if self.local:
            return self.start
        return torch.cat([self.start, coarse_maxima(likelihood, seed)[0]])


def fitted_effects(
    study: Study, model: StudyModel, measured: Measured, progress: Progress
) -> FittedEffects:
    """Fit the effects that a building lists; the basis that serves there is kept.

    Raises:
        BuildingError: an effect cannot be.
    """
    finder = finder_model(study, model, progress)
    phase = any(place.effect.needs_phase for place in building_effects(model.building).placed)
    data: list[Data] = []
    if measured.has_base:
        data.append(base_data(measured.runs, model.system, phase, table=COARSE_ERROR))
    data += data_of_forces(measured, model.system, use_phase=phase, table=COARSE_ERROR)
    data += data_of_modes(measured, model.system)
    problem, fitted = prepared(finder, data, progress=progress)
    problem, fitted = refined(finder, problem, fitted, progress, alone=True)
    local = problem.reduced.structure.operators is not None
    if local:
        keep_basis(study, problem.reduced, model.building)
    return FittedEffects(
        with_fitted(model, problem, fitted, finder.mesh), parameters_at(fitted), local
    )


def with_fitted(
    model: StudyModel, problem: Likelihood, fitted: Fit, mesh: MeshError | None
) -> StudyModel:
    """A study's model with the effects of a fit, on the basis that serves it.

    Args:
        mesh: error of the basis' mesh, where it is known.
    """
    return replace(
        model,
        system=fitted.system,
        prior=model.prior.of("stiffness") + effect_parameters(fitted.placed),
        shared=None if mesh is None else left_open(mesh, problem.reduced),
    )


FROM_FIT, FROM_LATENT, FROM_PRIOR = "the fit", "the latent", "the prior"
TEMPERED = "Importance sampling did not reach this posterior; the runs' spread is its error."
_LABEL = "Sampling (data-space likelihood)"
# Particles of Hamiltonian moves for each of up to four maxima, in groups of eight at least.
_POPULATION, _LEAST_GROUP, _MOST_MAXIMA = 128, 8, 4
# Levels of tempering, as many as were seen, and steps of a trajectory: of a told time alone.
_LEVELS, _STEPS = {False: 40, True: 18}, 4
# Gradients of a building do not go faster by the hundred on a processor.
_TRAJECTORIES = SmcSettings(unmoved=0.0, rows=32)


@dataclass(frozen=True, eq=False)
class Target:
    """What is sampled.

    Attributes:
        likelihood: of all that was measured, with its prior.
        maxima: of the posterior, in standard normal coordinates; None where they were not sought.
        origin: what they were found from, in words.
        local: whether the model serves about them alone.
        tried: points of the prior that were judged to find them.
    """

    likelihood: Likelihood
    maxima: Descent | None
    origin: str
    local: bool = False
    tried: int = 0


def sampled(target: Target, settings: CalibrationSettings, seed: Seed, show: Progress) -> Sampled:
    """Equally weighted draws: by importance draws about the maxima where enough of them count.

    Otherwise few parameters are tempered from the prior, from which no bend of the posterior is
    missed. Many parameters, and a model that serves about its fit alone, take trajectories.
    """
    many = target.likelihood.prior.size > FEW
    if target.maxima is not None and not many:
        drawn = sampled_about_maxima(target, settings.particles, seed, show)
        if drawn is not None:
            return drawn
    by = sampled_by_trajectories if many or target.local else sampled_by_particles
    return by(target, settings, seed, show)


def sampled_about_maxima(
    target: Target, count: int, seed: Seed, show: Progress = SILENT
) -> Sampled | None:
    """Equally weighted draws, by importance draws about the maxima; None where too few count."""
    assert target.maxima is not None
    prior, (drawing, choosing) = target.likelihood.prior, spawn(seed, 2)
    likelihood = on_fewer_shapes(target.likelihood, target.maxima, drawing)
    # Rounds of fitting take some hundred draws a parameter.
    total = count + 200 * prior.size
    ahead = _ahead(prior, likelihood, 64, total)
    show.start(f"Importance sampling ({ahead}, {total:,} responses of the building)", total)
    # A thousand at a time: all processors start and end together.
    counted = Counted(likelihood, show, rows=1024)
    found = draws_about(prior, counted, target.maxima, count, drawing)
    if found is None:
        return None
    found = replace(found, evaluations=found.evaluations + target.tried)
    note = (
        f"From {target.origin} to the data-space posterior took {found.evaluations:,} responses; "
        f"{percent(found.effective_share)} of the importance draws are effective."
    )
    runs = [found.resampled(count, choosing)]
    how = drawn_by("exact", "importance sampling about the maxima", runs)
    return Sampled(runs, prior, how, (note,), likelihood)


def sampled_chains(
    sampler: TemperedSmc, label: str, settings: CalibrationSettings, seed: Seed, show: Progress
) -> list[SamplerRun]:
    """Independent runs of a sampler, all from the prior, with their progress under a label."""
    # Levels and moves together take some forty likelihoods a particle.
    total = 40 * settings.each * settings.chains
    ahead = _ahead(sampler.prior, sampler.log_likelihood, settings.each, total)
    show.start(f"{label}, {ahead}", 100 * settings.chains)
    return [
        sampler.run(settings.each, stream, partial(_by_power, Percent(show)))
        for stream in spawn(seed, settings.chains)
    ]


def _ahead(prior: Parameters, likelihood: LogLikelihood, count: int, total: int) -> str:
    """The time that likelihoods of `total` draws take, told from that of `count`."""
    few = prior.sample(count, torch_generator(0))
    started = time.monotonic()
    likelihood(few)
    return waiting((time.monotonic() - started) * total / count)


def sampled_by_particles(
    target: Target, settings: CalibrationSettings, seed: Seed, show: Progress
) -> Sampled:
    """By particles from the prior, refined by importance draws where enough of these count."""
    prior, (first, second) = target.likelihood.prior, spawn(seed, 2)
    sampler = TemperedSmc(prior, target.likelihood, settings.smc)
    started = sampled_chains(sampler, _LABEL, settings, first, show)
    # Fitting the proposal usually takes three rounds of as many draws as there are particles.
    count = settings.each
    show.start("Importance sampling (data-space likelihood)", 7 * count * len(started))
    runs, more = [], 0
    for run, stream in zip(started, spawn(second, len(started)), strict=True):
        counted, (drawing, choosing) = Counted(target.likelihood, show), spawn(stream, 2)
        drawn = run
        try:
            found = draws_about_particles(prior, counted, run.theta, 4 * count, drawing)
            if found.effective_share > 0.1:
                drawn = found.resampled(count, choosing)
        except InferenceError:
            pass  # the particles stay
        more += counted.count
        spent = run.evaluations + counted.count
        runs.append(replace(drawn, evaluations=spent, levels=run.levels, invalid=run.invalid))
    least = min(run.effective_share for run in runs)
    text = (
        f"The sampler took {sum(run.evaluations for run in started):,} responses, importance "
        f"sampling {more:,} more"
    )
    refined = f"{text}; {percent(least)} of the importance draws are effective."
    notes = (refined,) if least > 0.0 else (f"{text}.", TEMPERED)
    way = "importance sampling" if least > 0.0 else "tempered particles"
    return Sampled(runs, prior, drawn_by("exact", way, runs), notes, target.likelihood)


def sampled_by_trajectories(
    target: Target, settings: CalibrationSettings, seed: Seed, show: Progress
) -> Sampled:
    """Groups of particles from about the maxima, or from the prior, by Hamiltonian moves."""
    prior, found, groups = target.likelihood.prior, target.maxima, settings.chains
    maxima = 1 if found is None else min(len(found.z), _MOST_MAXIMA)
    particles = groups * max(maxima * _POPULATION // groups, _LEAST_GROUP)
    start = None if found is None else wide_start(found)
    sampler = TemperedSmc(prior, target.likelihood, _TRAJECTORIES, ((Hamiltonian(), 3),), start)
    moves = 3 * _LEVELS[found is not None] + 6 + settings.particles // particles
    ahead = _ahead(prior, sampler.slopes, 32, _STEPS * moves * particles)
    show.start(f"{_LABEL} by trajectories, {ahead}", 200)
    bar = Percent(show)
    runs = sampler.draws(
        particles,
        settings.particles,
        seed,
        groups,
        partial(_by_power, bar),
        lambda share: bar.reached(1.0 + share),
    )
    note = (
        f"{particles} particles in {groups} groups, tempered in {runs[0].levels} levels with "
        f"Hamiltonian moves, went from {FROM_PRIOR if found is None else 'the maxima'} to the "
        f"data-space posterior by {sum(run.evaluations for run in runs):,} gradients of responses "
        f"({percent(runs[0].acceptance)} of the moves accepted)."
    )
    how = drawn_by("exact", "Hamiltonian moves", runs)
    return Sampled(runs, prior, how, (note,), target.likelihood)


def _by_power(bar: Percent, beta: float) -> None:
    """Move a bar evenly in the logarithm of beta, which runs from about 1e-5 to 1."""
    bar.reached(1.0 + max(math.log10(beta) / 5.0, -1.0), f"data count {100 * beta:.2g} %")


def sample_exact(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    seed: Seed,
    show: Progress,
    fitted: FittedEffects | None = None,
) -> Sampled:
    """Find the maxima of the data-space posterior, and draw it as `sampled` does."""
    first, second = spawn(seed, 2)
    show.start("Looking for the maxima of the likelihood", 1)
    target = _target(study, model, measured, settings, first, fitted)
    return sampled(target, settings, second, show)


def _target(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    seed: Seed,
    fitted: FittedEffects | None,
) -> Target:
    """The likelihood and its maxima."""
    if not measured.has_base and model.parameters.size > FEW and fitted is None:
        # Nothing is to be learned about the maxima.
        return Target(smooth_likelihood(model, measured), None, FROM_PRIOR)
    surrogate, starts, origin = None, None, FROM_PRIOR
    if fitted is not None:
        # A frame's model serves about its fit alone, so there no particles of the prior can help.
        model, origin = fitted.model, FROM_FIT
        starts = fitted.starts(smooth_likelihood(model, measured), settings.seed)
    elif not measured.beyond_surrogates:
        surrogate = find_surrogate(study, model.building)
    if surrogate is not None:
        latent = LatentLikelihood(surrogate[0], model.system, measured.base)
        starts, origin = latent.solutions(), FROM_LATENT
    found = settled_likelihood(
        model, measured, settings, starts, settings.seed if measured.has_base else seed
    )
    local = fitted is not None and fitted.local
    return Target(on_fewer_modes(found.likelihood), found.found, origin, local, found.tried)


def sample_latent(
    study: Study,
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    seed: Seed,
    show: Progress,
) -> Sampled:
    """Draw the latent posterior by particles."""
    observation, surrogate = measured.base, require_surrogate(study, model.building)
    show.start("Looking for the maxima of the likelihood", 1)
    likelihood = LatentLikelihood(
        surrogate,
        model.system,
        observation,
        learning=partial(settled_likelihood, model, measured, settings),
    )
    assert likelihood.settled is not None
    sampler = TemperedSmc(model.prior, likelihood, settings.smc)
    label = "Sampling (latent likelihood)"
    runs = sampled_chains(sampler, label, settings, spawn(seed, 1)[0], show)
    found, usual, warnings = likelihood.found, likelihood.usual_misfit, tuple[str, ...]()
    count = len(found.log_weight)
    pieces = "one Gaussian" if count == 1 else f"a mixture of {count} Gaussians"
    refined = (
        f"{found.responses:,} responses of the reduced model refined the surrogate's proposal to "
        f"{pieces}."
    )
    if found.misfit > usual:
        warnings = (
            "The observation is unlike anything that this building can do. The best response misses"
            f" it by {found.misfit**0.5:.2f} times the noise (rms); in 99.5 % of simulations it is "
            f"less than {usual**0.5:.2f}. Do not trust this posterior.",
        )
    return Sampled(
        runs,
        model.prior,
        drawn_by("latent", "tempered particles", runs, evidence=False),
        (*likelihood.notes, refined, *calibration_notes(surrogate.info, observation)),
        likelihood.settled.likelihood,
        latent=found,
        warnings=warnings,
    )
