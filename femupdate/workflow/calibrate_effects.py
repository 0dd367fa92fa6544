"""A building whose file lists effects, as the data ask for it, and its likelihood."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.likelihood import likelihood_about, parameters_at
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.mesh_scatter import mesh_scatter
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.records import SecondRecord, base_data
from femupdate.discrepancy.search import prepared, refined
from femupdate.discrepancy.thresholds import FIT
from femupdate.effects.registry import building_effects
from femupdate.inference.data import Data
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.maxima import found_from
from femupdate.inference.prior_search import best_of_prior
from femupdate.inference.priors import effect_parameters
from femupdate.progress import Progress
from femupdate.seeds import Seed
from femupdate.study import Study
from femupdate.surrogate.gauss_newton import Descent
from femupdate.workflow.amplitude import changes_with_level
from femupdate.workflow.diagnose import finder_model
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.finder_data import Given
from femupdate.workflow.kinds import Measured
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.second_record import level_between


@dataclass(frozen=True, eq=False)
class FittedEffects:
    """A model with effects, fitted to what was measured.

    Attributes:
        model: with its effects; of a frame on a basis about the fit.
        likelihood: of all that was measured.
        start: (1, p) parameters at the fit.
        local: whether the model serves about the fit alone.
    """

    model: StudyModel
    likelihood: Likelihood
    start: Tensor
    local: bool

    def maxima(self, seed: Seed) -> Descent:
        """Of the posterior, in standard normal coordinates.

        Where the model serves the whole prior, its likely points lead to other solutions.
        """
        likelihood, starts = self.likelihood, self.start
        prior = likelihood.prior
        if not self.local:
            coarse = likelihood.coarse(FIT.coarse_noise)
            likely, _ = best_of_prior(prior, coarse.log_density, seed)
            ended = found_from(prior, coarse.residuals, likely[: prior.size])
            starts = torch.cat([starts, prior.from_normal(ended.z)])
        return found_from(prior, likelihood.residuals, starts)


def fitted_effects(
    study: Study,
    model: StudyModel,
    measured: Measured,
    progress: Progress,
) -> FittedEffects:
    """Fit the effects that a building lists; the basis that serves there is kept.

    Raises:
        BuildingError: an effect cannot be.
    """
    finder = finder_model(study, model, progress)
    data = _data(model, measured, finder.mesh)
    problem, fitted = prepared(finder, data, None, progress)
    problem, fitted = refined(finder, problem, fitted, progress, alone=True)
    local = problem.reduced.structure.operators is not None
    if local:
        keep_basis(study, problem.reduced, model.building)
    return FittedEffects(
        with_fitted(model, problem, fitted, finder.mesh),
        likelihood_about(problem, fitted),
        parameters_at(fitted),
        local,
    )


def with_fitted(
    model: StudyModel, problem: Problem, fitted: Fit, mesh: MeshError | None
) -> StudyModel:
    """A study's model with the effects of a fit, on the basis that serves it.

    Args:
        mesh: error of the basis' mesh, where it is known.
    """
    return replace(
        model,
        system=fitted.system,
        prior=model.prior.of("stiffness") + effect_parameters(fitted.placed),
        shared=None if mesh is None else mesh_scatter(problem.reduced, fitted.system, mesh),
    )


def _data(model: StudyModel, measured: Measured, mesh: MeshError | None) -> tuple[Data, ...]:
    """All that was measured, as the finder judges it; phases where |H| does not show an effect."""
    phase = any(one.effect.needs_phase for one in building_effects(model.building).placed)
    nothing = replace(measured.base, valid=np.zeros_like(measured.base.valid))
    others = replace(measured, base=nothing)
    parts = Given(others).data(model, mesh, use_phase=phase)
    if not measured.has_base:
        return parts
    levels = measured.levels or (0.0,) * len(measured.runs)
    first, *further = map(SecondRecord, measured.runs, levels)
    base = base_data(model.building, mesh, first.observation, phase, (), further)
    return (base, *parts)


def with_levels(model: StudyModel, source: ObservationSource, measured: Measured) -> Measured:
    """What was measured, with every run's level where effects of the building depend on it.

    Raises:
        MeasurementError: a file says no level.
    """
    changes = changes_with_level(building_effects(model.building).placed)
    if not changes or len(measured.runs) < 2:
        return measured
    first, *further = measured.base_paths
    own, *others = replace(source, path=first, further=tuple(further)).runs
    levels = (0.0, *(level_between(model, own, other) for other in others))
    others_of = zip(measured.runs[1:], levels[1:], strict=True)
    each = ", ".join(f"{run.source} at {2.0**level:.2g} times" for run, level in others_of)
    said = (
        f"{len(levels)} runs are explained together, each at its own level: {each} that of "
        f"{measured.runs[0].source}."
    )
    # Whether they agree with one another is no question where the level changes the building.
    base = replace(measured.base, notes=(said, *measured.base.notes[1:]))
    return replace(measured, levels=levels, base=base)
