"""A study's building as the effect finder needs it: a reduced structure, its effects, its data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from femupdate.array_archive import ArchiveError, check_shapes, read_arrays, write_arrays
from femupdate.arrays import Floats
from femupdate.building.document import without_effects
from femupdate.building.effect_entry import EffectEntry
from femupdate.building.files import mechanics_hash
from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.discrepancy.data import Data
from femupdate.discrepancy.problem import Problem, make_problem
from femupdate.discrepancy.thresholds import MESH_ERROR, MODEL_ERROR
from femupdate.dynamics.damping import damping_law
from femupdate.dynamics.projection import lumped, reduced_on
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.dynamics.reduction import reduce_structure
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.dynamics.system import System, parameters_of
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import Structure, require_story_factors, structure_of
from femupdate.errors import BuildingError
from femupdate.inference.parameters import Parameter, Parameters
from femupdate.progress import Progress, Silent
from femupdate.study import Study, damaged
from femupdate.workflow.model import StudyModel, damping_parameter, reduction_target, theta_prior

BASIS = "effect basis"
_FILE = "effect_basis.npz"


@dataclass(frozen=True)
class BuildingEffects:
    """The effects that a building file lists.

    Attributes:
        placed: effects at their places.
        values: all their parameters, one after the other.
    """

    placed: tuple[Placed, ...]
    values: tuple[float, ...]


def open_structure(
    study: Study, building: Building, progress: Progress | None = None
) -> ReducedStructure:
    """The reduced structure of a study's building, on the basis that the study keeps.

    Without one a basis for the building's effects over the whole prior is made (of a frame, in
    minutes), and kept.
    """
    structure = finder_structure(building)
    if structure.is_stick:
        return lumped(structure)
    kept = study.find(BASIS, finder_origin(building))
    if kept is not None:
        return reduced_on(structure, read_basis(kept, structure))
    placed = building_effects(building).placed
    target = with_size_ranges(reduction_target(building), placed)
    reduced = reduce_structure(structure, target, placed, progress or Silent()).reduced
    keep_basis(study, reduced, building)
    return reduced


def with_size_ranges(target: ReductionTarget, placed: Sequence[Placed]) -> ReductionTarget:
    """A target whose box holds what is likely of the sizes of effects besides."""
    likely = np.array([one.likely for one in parameters_of(placed)]).reshape(-1, 2)
    return replace(
        target,
        lower=np.concatenate([target.lower, likely[:, 0]]),
        upper=np.concatenate([target.upper, likely[:, 1]]),
    )


def finder_structure(building: Building) -> Structure:
    """The full model in which effects act: a frame of ours on a mesh finer than the study's.

    The study's mesh is chosen for a hundred thousand responses; here some twenty solutions are
    needed, and half of the error of a mesh is worth them.
    """
    require_story_factors(building)
    return structure_of(without_effects(building), finder_mesh_size(building))


def finder_mesh_size(building: Building) -> float | None:
    """Of the finder's mesh, m; None for what is not meshed here."""
    return MESH_ERROR.finer * building.mesh.size if isinstance(building, FrameBuilding) else None


def finder_origin(building: Building) -> dict[str, str]:
    """What everything about the finder's mesh is made from, for the study's record."""
    origin = {"building": mechanics_hash(without_effects(building))}
    size = finder_mesh_size(building)
    return origin if size is None else {**origin, "mesh_m": f"{size:.4g}"}


def plain_structure(model: StudyModel) -> ReducedStructure:
    """The structure on the study's own basis, which knows the story factors alone."""
    require_story_factors(model.building)
    structure = structure_of(without_effects(model.building))
    if structure.is_stick:
        return lumped(structure)
    return ReducedStructure(structure, model.reduced, np.zeros((len(structure.axis), 0)))


def keep_basis(study: Study, reduced: ReducedStructure, building: Building) -> Path:
    """Write the basis of a building into a study."""
    path = study.path(_FILE)
    write_arrays(path, basis=reduced.basis)
    study.record(BASIS, _FILE, "diagnose", finder_origin(building), {"size": reduced.model.size})
    return path


def read_basis(path: Path, structure: Structure) -> Floats:
    """A basis (n, r) that a study keeps for a structure of n degrees of freedom.

    Raises:
        StudyError: the file holds no such basis.
    """
    try:
        data = read_arrays(path)
        check_shapes(data, {"basis": "nr"})
    except ArchiveError as error:
        raise damaged(path, error) from error
    if len(data["basis"]) != len(structure.axis):
        raise damaged(path, f"basis of {len(data['basis'])} degrees of freedom")
    return data["basis"]


def building_effects(building: Building) -> BuildingEffects:
    """The effects of a building file, checked against the catalogue.

    Raises:
        BuildingError: an effect or a parameter is unknown, a value is impossible, or the same
            effect is listed twice at one place.
    """
    placed: list[Placed] = []
    values: list[float] = []
    for number, entry in enumerate(building.effects):
        if entry.name not in CATALOGUE:
            raise BuildingError(
                f"{building.name}: effects[{number}].name: no effect is named {entry.name!r}; the "
                f"known ones are {', '.join(CATALOGUE)}"
            )
        effect = CATALOGUE[entry.name]
        if Placed(effect, entry.place) in placed:
            raise BuildingError(
                f"{building.name}: effects[{number}]: {entry.name} at {entry.place} is listed "
                "twice; keep one of the two"
            )
        known = {p.name: p for p in effect.parameters}
        for name, value in entry.parameters.items():
            if name not in known:
                raise BuildingError(
                    f"{building.name}: effects[{number}].parameters.{name}: {entry.name} has no "
                    f"such parameter; it has {', '.join(known) or 'none'}"
                )
            if not known[name].lower <= value <= known[name].upper:
                raise BuildingError(
                    f"{building.name}: effects[{number}].parameters.{name}: {value:g} must lie "
                    f"from {known[name].lower:g} to {known[name].upper:g}"
                )
        placed.append(Placed(effect, entry.place))
        values += [float(entry.parameters.get(p.name, p.neutral)) for p in effect.parameters]
    return BuildingEffects(tuple(placed), tuple(values))


def size_names(placed: Sequence[Placed]) -> tuple[str, ...]:
    """Names of the parameters of effects, such as `added_mass@3F.size`."""
    return tuple(f"{one.label}.{p.name}" for one in placed for p in one.effect.parameters)


def effect_parameters(placed: Sequence[Placed]) -> Parameters:
    """The effects' parameters with the priors of the catalogue, within what is likely."""
    pairs = zip(size_names(placed), parameters_of(placed), strict=True)
    return Parameters(
        tuple(
            Parameter(
                name=name,
                kind="effect",
                lower=one.likely[0],
                upper=one.likely[1],
                neutral=one.neutral,
                centre=one.neutral,
                scale=one.scale,
            )
            for name, one in pairs
        )
    )


def check_places(structure: Structure, effects: BuildingEffects) -> None:
    """Make sure that every effect of a building can sit where its file says.

    Raises:
        BuildingError: it cannot.
    """
    for number, one in enumerate(effects.placed):
        places = one.effect.places(structure)
        if one.place not in (*places, *one.effect.points(structure)):
            raise BuildingError(
                f"{structure.building.name}: effects[{number}].place: {one.effect.name} "
                f"cannot sit at {one.place!r}; it can at {', '.join(places) or 'no place here'}"
            )


def check_sizes(building: Building, system: System, values: Sequence[float]) -> None:
    """Make sure that the effects of a building leave it stiff in every direction.

    Args:
        building: that lists them.
        system: with them.
        values: their parameters, one after the other.

    Raises:
        BuildingError: they do not; two effects may each be possible and take too much together.
    """
    theta = torch.ones(1, system.factors, dtype=torch.float64)
    inverse = system.modes(theta, torch.tensor([list(values)], dtype=torch.float64)).inverse
    if not torch.isfinite(inverse).all():
        listed = ", ".join(one.label for one in system.placed)
        raise BuildingError(
            f"{building.name}: effects: {listed}: together they take away more stiffness than "
            "there is; give smaller changes, or remove one that says the same"
        )


def with_effect(building: Building, placed: Placed, values: Floats) -> Building:
    """The building with one effect more.

    Args:
        building: as it is.
        placed: the effect.
        values: its parameters.
    """
    parameters = {
        p.name: float(f"{v:.6g}") for p, v in zip(placed.effect.parameters, values, strict=True)
    }
    entry = EffectEntry(name=placed.effect.name, place=placed.place, parameters=parameters)
    return building.model_copy(update={"effects": (*building.effects, entry)})


def problem_of(reduced: ReducedStructure, building: Building, data: Sequence[Data]) -> Problem:
    """A building and what was observed of it, for the effect finder."""
    prior, damping = theta_prior(building), damping_parameter(building)
    return make_problem(
        reduced,
        damping_law(building),
        (prior.lower, prior.upper),
        (damping.lower, damping.upper) if damping.free else damping.lower,
        data,
        0.0 if building.kind == "shear" else MODEL_ERROR.size,
    )
