"""A building whose file lists effects, as the data ask for it, and its likelihood."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.discrepancy.fit import COARSE_NOISE, Fit, parameters_at
from femupdate.discrepancy.mesh_error import MeshError, left_open
from femupdate.discrepancy.search import prepared, refined
from femupdate.effects.registry import building_effects
from femupdate.inference.likelihood import Data, Likelihood
from femupdate.inference.maxima import best_of_prior, found_from
from femupdate.inference.model_error import COARSE_ERROR
from femupdate.inference.parameters import effect_parameters
from femupdate.progress import Progress
from femupdate.seeds import Seed
from femupdate.study import Study
from femupdate.workflow.amplitude import changes_with_level, level_between
from femupdate.workflow.diagnose import finder_model
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import base_data, data_of_forces, data_of_modes
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource


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
        prior, coarse = likelihood.prior, likelihood.coarse(COARSE_NOISE)
        likely, _ = best_of_prior(prior, coarse.log_density, seed)
        ended = found_from(prior, coarse.residuals, likely[: prior.size])
        return torch.cat([self.start, prior.from_normal(ended.z)])


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


def with_levels(model: StudyModel, source: ObservationSource, measured: Measured) -> Measured:
    """What was measured, with every run's level where effects of the building depend on it.

    Raises:
        MeasurementError: a file says no level.
    """
    changes = changes_with_level(building_effects(model.building).placed)
    if not changes or len(measured.runs) < 2:
        return measured
    first, *others = (replace(source, path=path, further=()) for path in measured.base_paths)
    levels = [0.0, *(level_between(model, first, other) for other in others)]
    runs = tuple(
        replace(run, level=level) for run, level in zip(measured.runs, levels, strict=True)
    )
    each = ", ".join(f"{run.source} at {2.0**run.level:.2g} times" for run in runs[1:])
    said = (
        f"{len(runs)} runs are explained together, each at its own level: {each} that of "
        f"{runs[0].source}."
    )
    # Whether they agree with one another is no question where the level changes the building.
    base = replace(measured.base, notes=(said, *measured.base.notes[1:]))
    return replace(measured, runs=runs, base=base)
