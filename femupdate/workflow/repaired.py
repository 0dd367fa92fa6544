"""The repaired building: its file, and the study that every command takes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from femupdate.building.document import without_effects
from femupdate.building.files import save_building
from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.discrepancy.data import Data
from femupdate.discrepancy.fit import Fit, raw_residuals
from femupdate.discrepancy.frf_data import FrfData
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.posterior import Draws
from femupdate.discrepancy.repair import Repair
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.effects.listed import building_effects, with_effect
from femupdate.inference.draw_errors import errors_in_parts
from femupdate.inference.error_draws import ErrorDraws
from femupdate.inference.model_error import LearnedError
from femupdate.inference.posterior import Posterior, save_posterior
from femupdate.inference.predictive_check import PredictiveCheck, predictive_check
from femupdate.inference.priors import effect_parameters
from femupdate.measurement.observation import Observation
from femupdate.study import BUILDING_FILE, REPAIRED, Study
from femupdate.workflow.calibrate_draws import Fitting
from femupdate.workflow.calibrate_notes import judgement
from femupdate.workflow.calibrate_settings import by_importance
from femupdate.workflow.calibration_report import POSTERIOR
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.finer_mesh import keep_finer
from femupdate.workflow.mesh_error import keep_mesh_error
from femupdate.workflow.model import StudyModel, keep_model, open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.thresholds import CALIBRATION

_ERRING = 0  # seed of the errors' sizes
FEW_COUNT = "Few proposals count: the posterior is not of one piece; trust it little."


def repaired_building(building: Building, done: Repair) -> Building:
    """The building with all effects of the last fit at their fitted values."""
    repaired = without_effects(building)
    values, first = done.after.sizes()[0], 0
    for placed in done.after.placed:
        count = len(placed.effect.parameters)
        repaired = with_effect(repaired, placed, values[first : first + count])
        first += count
    names = "; ".join(one.finding.placed.in_words for one in done.rounds)
    text = f"{building.description.rstrip()}\nRepaired: {names}.".strip()
    return repaired.model_copy(update={"description": text})


def keep_repaired(
    study: Study,
    model: StudyModel,
    building: Building,
    reduced: ReducedStructure,
    mesh: MeshError | None,
) -> Study:
    """A study of the repaired building, with its file, reduced model and basis.

    Args:
        study: in whose folder it goes.
        model: of the building as it was.
        building: as repaired.
        reduced: structure on the basis on which the repaired model was fitted.
        mesh: its error, where it is known.
    """
    kept = Study(study.path(REPAIRED))
    kept.folder.mkdir(parents=True, exist_ok=True)
    save_building(building, kept.path(BUILDING_FILE))
    keep_model(kept, building, model.reduced, model.reduction_error)
    if reduced.structure.operators is not None:
        keep_basis(kept, reduced, building)
    if mesh is not None:
        keep_mesh_error(kept, building, mesh)
    if model.finer is not None and isinstance(building, FrameBuilding):
        keep_finer(kept, building, model.finer)
    return kept


def keep_effect_posterior(
    study: Study,
    observation: Observation,
    source: ObservationSource,
    fitted: tuple[Fit, Draws],
    settings: Mapping[str, Any],
) -> None:
    """Keep draws of a repaired building as the posterior of its study.

    Args:
        study: of the repaired building.
        observation: what it was fitted to.
        fitted: the last fit, and draws about it.
    """
    model = open_study(study)
    posterior = effect_posterior(model, observation, *fitted, settings)
    save_posterior(posterior, study.result("posterior.nc"))
    origin = {**model.made_from(), **source.made_from()}
    study.record(POSTERIOR, "posterior.nc", "repair", origin, source.files_as_settings())


def effect_posterior(
    model: StudyModel,
    observation: Observation,
    fitted: Fit,
    draws: Draws,
    settings: Mapping[str, Any],
) -> Posterior:
    """Draws of a building with effects as a posterior whose last columns are their parameters.

    With what the model errs by, and what whoever uses the draws should know.
    """
    effects = building_effects(model.building)
    prior = model.prior + effect_parameters(effects.placed)
    both = np.column_stack([draws.theta, draws.sizes])
    posterior = Posterior(
        names=prior.names,
        theta=both[None],
        zeta=draws.zeta[None] if model.damping.free else None,
        log_likelihood=draws.log_likelihood[None],
        lower=prior.lower.numpy(),
        upper=prior.upper.numpy(),
        drawn=by_importance("importance sampling about the best fit", [draws]),
        observation=observation,
        settings={"particles": len(both), "exact": True, **settings},
        model_error=_errors(observation, fitted, draws),
    )
    few = () if draws.effective >= CALIBRATION.few_draws else (FEW_COUNT,)
    fitting = Fitting(misfit_of(fitted), check_of(fitted, draws))
    return replace(posterior, warnings=(*few, *judgement(posterior, fitting)))


def misfit_of(fitted: Fit) -> float:
    """Mean squared residual of independent points, by the noise alone."""
    return fitted.chi2 / max(fitted.problem.effective, 1.0)


def check_of(fitted: Fit, draws: Draws) -> PredictiveCheck:
    """Posterior predictive check; what the model errs by is part of what is allowed for."""
    parts = _residuals(fitted, draws)
    found: list[tuple[str, torch.Tensor, float]] = []
    for data, error, own, row in zip(*parts, fitted.problem.row, strict=True):
        rows = torch.full((len(own),), row)
        found += data.checked(error.floor_squares(error.tame(own, row), rows))
    names, left, counts = zip(*found, strict=True)
    return predictive_check(torch.stack(left, dim=1).numpy(), counts, names)


def _errors(observation: Observation, fitted: Fit, draws: Draws) -> ErrorDraws | None:
    """What the model errs by in FRFs under base motion; None where there are none."""
    for data, error, own in zip(*_residuals(fitted, draws), strict=True):
        if isinstance(data, FrfData) and not data.forced:
            count = len(draws.theta)
            return errors_in_parts(error, own, data.names, observation, count, _ERRING)
    return None


def _residuals(
    fitted: Fit, draws: Draws
) -> tuple[tuple[Data, ...], tuple[LearnedError, ...], tuple[torch.Tensor, ...]]:
    """Every kind of data with its table of errors, and residuals (n, m) at some of the draws."""
    some = slice(None, None, max(1, len(draws.theta) // CALIBRATION.checked))
    known = (torch.from_numpy(values[some]) for values in (draws.theta, draws.zeta, draws.sizes))
    raw = raw_residuals(fitted, fitted.coordinates.joined(*known))
    problem = fitted.problem
    return problem.data, problem.error.parts, problem.error.apart(raw)
