"""The repaired building: its file, and the study that every command takes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from femupdate.building.document import without_effects
from femupdate.building.files import save_building
from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.posterior import Draws
from femupdate.discrepancy.repair import Repair
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.effects.listed import building_effects, with_effect
from femupdate.inference.posterior import Posterior, save_posterior
from femupdate.inference.priors import effect_parameters
from femupdate.measurement.observation import Observation
from femupdate.study import BUILDING_FILE, REPAIRED, Study
from femupdate.workflow.calibrate_settings import by_importance
from femupdate.workflow.calibration_report import POSTERIOR
from femupdate.workflow.effects import keep_basis
from femupdate.workflow.finer_mesh import keep_finer
from femupdate.workflow.mesh_error import keep_mesh_error
from femupdate.workflow.model import StudyModel, keep_model, open_study
from femupdate.workflow.observed import ObservationSource


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
    draws: Draws,
    settings: Mapping[str, Any],
) -> None:
    """Keep draws of a repaired building as the posterior of its study.

    Args:
        study: of the repaired building.
        observation: what it was fitted to.
    """
    model = open_study(study)
    posterior = effect_posterior(model, observation, draws, settings)
    save_posterior(posterior, study.result("posterior.nc"))
    origin = {**model.made_from(), **source.made_from()}
    study.record(POSTERIOR, "posterior.nc", "repair", origin, source.files_as_settings())


def effect_posterior(
    model: StudyModel, observation: Observation, draws: Draws, settings: Mapping[str, Any]
) -> Posterior:
    """Draws of a building with effects as a posterior whose last columns are their parameters."""
    effects = building_effects(model.building)
    prior = model.prior + effect_parameters(effects.placed)
    both = np.column_stack([draws.theta, draws.sizes])
    return Posterior(
        names=prior.names,
        theta=both[None],
        zeta=draws.zeta[None] if model.damping.free else None,
        log_likelihood=draws.log_likelihood[None],
        lower=prior.lower.numpy(),
        upper=prior.upper.numpy(),
        drawn=by_importance("importance sampling about the best fit", [draws]),
        observation=observation,
        settings={"particles": len(both), "exact": True, **settings},
    )
