"""The model behind a surrogate of a building that lists effects."""

from dataclasses import replace

from femupdate.arrays import Floats
from femupdate.building.schema import Building
from femupdate.discrepancy.finder_model import check_sizes, finder_structure
from femupdate.discrepancy.mesh_error import corrected
from femupdate.discrepancy.mesh_scatter import mesh_scatter
from femupdate.dynamics.projection import reduced_on
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.dynamics.reduction import reduce_structure
from femupdate.dynamics.system import System, changes_in_run, makes_modes_complex
from femupdate.effects.effect import Placed
from femupdate.effects.listed import BuildingEffects, building_effects, check_places
from femupdate.effects.structure import Structure
from femupdate.errors import SurrogateError
from femupdate.inference.parameters import Parameters
from femupdate.inference.priors import effect_parameters, reduction_target
from femupdate.progress import SILENT, Progress
from femupdate.study import Study, StudyPart
from femupdate.workflow.effects import basis_part, open_structure
from femupdate.workflow.mesh_error import kept_mesh_error, open_mesh_error
from femupdate.workflow.model import StudyModel


def check_amortisable(building: Building) -> None:
    """Make sure that a surrogate can know the effects that a building lists.

    Raises:
        BuildingError: an effect is unknown or impossible.
        SurrogateError: one makes modes complex or changes the structure during the run.
    """
    for one in building_effects(building).placed:
        if makes_modes_complex(one.effect):
            raise SurrogateError(
                f"{building.name}: {one.effect.name} at {one.place} makes the modes complex, which "
                "no surrogate follows; calibrate with --exact"
            )
        if changes_in_run(one.effect):
            raise SurrogateError(
                f"{building.name}: {one.effect.name} changes the structure during the run, which "
                "no surrogate follows; calibrate with --exact"
            )


def with_effects(study: Study, model: StudyModel, progress: Progress = SILENT) -> StudyModel:
    """A study's model with the effects that its building lists and a prior of their sizes.

    Raises:
        BuildingError: an effect cannot be.
        SurrogateError: one makes modes complex.
    """
    check_amortisable(model.building)
    effects = building_effects(model.building)
    prior = model.prior + effect_parameters(effects.placed)
    structure = finder_structure(model.building)
    check_places(structure, effects)
    reduced = _reduced(study, model, structure, (effects.placed, prior), progress)
    mesh = open_mesh_error(study, model, structure, progress)
    reduced = reduced if mesh is None else corrected(reduced, mesh)
    system = _system(model, reduced, effects)
    shared = None if mesh is None else mesh_scatter(reduced, system, mesh)
    return replace(model, system=system, shared=shared, prior=prior)


def _system(model: StudyModel, reduced: ReducedStructure, effects: BuildingEffects) -> System:
    """A reduced structure with the effects that its building lists."""
    terms = tuple(reduced.terms(one) for one in effects.placed)
    system = System(reduced.model, model.law, effects.placed, terms)
    check_sizes(model.building, system, effects.values)
    return system


def open_system(study: Study, model: StudyModel) -> System:
    """The study's reduced model with the effects that its building lists, if any."""
    if len(model.building.effects) == len(model.system.placed):
        return model.system
    reduced = kept_structure(study, model) or open_structure(study, model.building)
    mesh = kept_mesh_error(study, model.building)
    if mesh is not None:
        reduced = corrected(reduced, mesh)
    effects = building_effects(model.building)
    check_places(reduced.structure, effects)
    return _system(model, reduced, effects)


def kept_structure(
    study: Study, model: StudyModel, structure: Structure | None = None
) -> ReducedStructure | None:
    """A frame on the basis that its surrogate was made with, or None where there is none.

    Args:
        structure: the full model, if it is at hand.
    """
    whole = structure or finder_structure(model.building)
    kept = study.kept(_basis(whole), model.made_from())
    return None if kept is None else reduced_on(whole, kept)


def _basis(structure: Structure) -> StudyPart[Floats]:
    return basis_part("surrogate's basis", "surrogate_basis.npz", "train", structure)


def _reduced(
    study: Study,
    model: StudyModel,
    structure: Structure,
    acting: tuple[tuple[Placed, ...], Parameters],
    progress: Progress,
) -> ReducedStructure:
    """The structure on a basis for the prior's whole box; that of a frame is made once and kept."""
    placed, prior = acting
    kept = kept_structure(study, model, structure)
    if kept is not None:
        return kept
    lower, upper = prior.lower.numpy(), prior.upper.numpy()
    target = replace(reduction_target(model.building), lower=lower, upper=upper)
    found = reduce_structure(structure, target, placed, progress)
    if structure.is_stick:
        return found.reduced
    study.keep(_basis(structure), model.made_from(), found.reduced.basis)
    return found.reduced
