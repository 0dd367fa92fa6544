"""Bases on which the effects of a study's building act, as the study keeps them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building, mechanics_hash, without_effects
from femupdate.discrepancy.search import finder_mesh_size, finder_structure
from femupdate.dynamics.reduced import ReducedStructure, lumped, reduced_on
from femupdate.dynamics.reduction import reduce_structure
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.dynamics.system import parameters_of
from femupdate.effects.effect import Placed
from femupdate.effects.registry import building_effects
from femupdate.effects.structure import Structure
from femupdate.inference.parameters import reduction_target
from femupdate.progress import SILENT, Progress
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.study import Study, StudyPart

BASIS, NEAR_BASIS = "effect basis", "finder's basis"


def open_structure(
    study: Study, building: Building, progress: Progress = SILENT
) -> ReducedStructure:
    """The reduced structure of a study's building, on the basis that the study keeps.

    Without one a basis for the building's effects over the whole prior is made (of a frame, in
    minutes), and kept.
    """
    structure = finder_structure(building)
    if structure.is_stick:
        return lumped(structure)

    def make() -> Floats:
        placed = building_effects(building).placed
        target = with_size_ranges(reduction_target(building), placed)
        return reduce_structure(structure, target, placed, progress).reduced.basis

    basis = study.cached(basis_part(BASIS, structure), finder_origin(building), make)
    return reduced_on(structure, basis)


def with_size_ranges(target: ReductionTarget, placed: Sequence[Placed]) -> ReductionTarget:
    """A target whose box holds what is likely of the sizes of effects besides."""
    likely = np.array([parameter.likely for parameter in parameters_of(placed)]).reshape(-1, 2)
    return replace(
        target,
        lower=np.concatenate([target.lower, likely[:, 0]]),
        upper=np.concatenate([target.upper, likely[:, 1]]),
    )


def finder_origin(building: Building) -> dict[str, str]:
    """What everything about the finder's mesh is made from, for the study's record."""
    origin = {"building": mechanics_hash(without_effects(building))}
    size = finder_mesh_size(building)
    return origin if size is None else {**origin, "mesh_m": f"{size:.4g}"}


def keep_basis(study: Study, reduced: ReducedStructure, building: Building) -> None:
    """Write the basis of a building into a study."""
    study.keep(basis_part(BASIS, reduced.structure), finder_origin(building), reduced.basis)


def basis_part(name: str, structure: Structure) -> StudyPart[Floats]:
    """A basis (n, r) for a structure of n degrees of freedom, as a study keeps it."""

    def write(basis: Floats, path: Path) -> None:
        write_arrays(path, basis=basis)

    def read(path: Path) -> Floats:
        data = read_arrays(path)
        check_shapes(data, {"basis": "nr"})
        if len(data["basis"]) != len(structure.axis):
            raise ValueError(f"basis of {len(data['basis'])} degrees of freedom")
        return data["basis"]

    file = {BASIS: "effect_basis.npz", NEAR_BASIS: "finder_basis.npz"}[name]
    return StudyPart(name, file, "diagnose", write, read, lambda basis: {"size": basis.shape[1]})


def finder_basis(
    study: Study,
    building: Building,
    structure: Structure,
    theta: Floats,
    zeta: float,
    make: Callable[[], Floats],
) -> Floats:
    """The last basis (n, r) about theta (p,) in which every effect of a building may act."""
    origin = {
        **finder_origin(building),
        "theta": " ".join(f"{factor:.4g}" for factor in theta),
        "zeta": f"{zeta:.4g}",
    }
    return study.cached(basis_part(NEAR_BASIS, structure), origin, make)
