"""The repaired building: its file, and the study that every command takes."""

from femupdate.building.document import Building, without_effects
from femupdate.building.files import save_building
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.repair import Repair
from femupdate.dynamics.reduced import ReducedStructure
from femupdate.effects.registry import with_effect
from femupdate.effects.tolerances import tolerances_of
from femupdate.inference.posterior import save_posterior
from femupdate.seeds import Seed, spawn
from femupdate.study import BUILDING_FILE, REPAIRED, Study
from femupdate.workflow.amplitude import level_settings
from femupdate.workflow.calibration_report import POSTERIOR
from femupdate.workflow.conclusion import concluded
from femupdate.workflow.effects import finder_origin, keep_basis
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import CalibrationSettings, Sampled
from femupdate.workflow.mesh_error import MESH_ERROR_PART
from femupdate.workflow.model import (
    FINER_PART,
    CertifiedModel,
    StudyModel,
    finer_origin,
    keep_model,
)
from femupdate.workflow.observed import ObservationSource


def repaired_building(building: Building, done: Repair) -> Building:
    """The building with all effects of the last fit at their fitted values."""
    repaired = without_effects(building)
    varying = tolerances_of(building)
    for number, placed in enumerate(done.after.placed):
        if placed not in varying:  # the file states them still
            repaired = with_effect(repaired, placed, done.after.known_of(number))
    names = "; ".join(added.finding.placed.in_words for added in done.rounds)
    text = f"{building.description.rstrip()}\nRepaired: {names}.".strip()
    return repaired.model_copy(update={"description": text})


def keep_repaired(
    study: Study,
    model: StudyModel,
    building: Building,
    reduced: ReducedStructure,
    mesh: MeshError | None,
) -> Study:
    """A study of the repaired building in a study's folder, with its reduced model and basis.

    Args:
        model: of the building as it was.
        building: as repaired.
        reduced: structure on the basis on which the repaired model was fitted.
        mesh: its error, where it is known.
    """
    kept = Study(study.path(REPAIRED))
    kept.folder.mkdir(parents=True, exist_ok=True)
    save_building(building, kept.path(BUILDING_FILE))
    keep_model(kept, building, CertifiedModel(model.reduced, model.reduction_error))
    if reduced.structure.operators is not None:
        keep_basis(kept, reduced, building)
    if mesh is not None:
        kept.keep(MESH_ERROR_PART, finder_origin(building), mesh)
    if model.finer is not None:
        kept.keep(FINER_PART, finer_origin(building), model.finer)
    return kept


def keep_repaired_posterior(
    study: Study,
    model: StudyModel,
    measured: Measured,
    source: ObservationSource,
    sampled: Sampled,
    seed: Seed,
    levels: tuple[float, ...],
) -> None:
    """Keep draws of a repaired building as the posterior of its study.

    Args:
        model: with all that was added, as it was fitted.
        levels: of the records, in doublings above the first.
    """
    drawing, count = spawn(seed, 4), len(sampled.runs[0].theta)
    settings = CalibrationSettings(particles=count, exact=True, chains=1, anyway=True)
    path = study.result("posterior.nc")
    report = concluded(model, measured, settings, sampled, drawing, path).with_settings(
        level_settings(model, model.system.placed, source, levels)
    )
    save_posterior(report.posterior, path)
    origin = {**model.made_from(), **source.made_from()}
    study.record(POSTERIOR, "posterior.nc", "repair", origin, source.files_as_settings())
    report.write_summary(study)
