"""Bases on which the effects of a study's building act, as the study keeps them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femupdate.array_archive import check_shapes, read_arrays, write_arrays
from femupdate.arrays import Floats
from femupdate.building.document import without_effects
from femupdate.building.files import mechanics_hash
from femupdate.building.schema import Building
from femupdate.discrepancy.finder_model import finder_mesh_size, finder_structure
from femupdate.dynamics.projection import lumped, reduced_on
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.dynamics.reduction import reduce_structure
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.dynamics.system import parameters_of
from femupdate.effects.effect import Placed
from femupdate.effects.listed import building_effects
from femupdate.effects.structure import Structure
from femupdate.inference.priors import reduction_target
from femupdate.progress import SILENT, Progress
from femupdate.study import Study, as_written

BASIS, NEAR_BASIS = "effect basis", "finder's basis"
_FILE, _NEAR_FILE = "effect_basis.npz", "finder_basis.npz"


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
    kept = study.find(BASIS, finder_origin(building))
    if kept is not None:
        return reduced_on(structure, read_basis(kept, structure))
    placed = building_effects(building).placed
    target = with_size_ranges(reduction_target(building), placed)
    reduced = reduce_structure(structure, target, placed, progress).reduced
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


def finder_origin(building: Building) -> dict[str, str]:
    """What everything about the finder's mesh is made from, for the study's record."""
    origin = {"building": mechanics_hash(without_effects(building))}
    size = finder_mesh_size(building)
    return origin if size is None else {**origin, "mesh_m": f"{size:.4g}"}


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
    with as_written(path):
        data = read_arrays(path)
        check_shapes(data, {"basis": "nr"})
        if len(data["basis"]) != len(structure.axis):
            raise ValueError(f"basis of {len(data['basis'])} degrees of freedom")
        return data["basis"]


@dataclass(frozen=True)
class StudyBases:
    """Keeps the last basis in which every effect of a building may act.

    Attributes:
        study: that keeps it.
        building: whose full model it reduces.
    """

    study: Study
    building: Building

    def find(self, structure: Structure, theta: Floats, zeta: float) -> Floats | None:
        """The basis (n, r) kept for theta (p,) and zeta, or None.

        Raises:
            StudyError: its file is damaged.
        """
        kept = self.study.find(NEAR_BASIS, self._origin(theta, zeta))
        return None if kept is None else read_basis(kept, structure)

    def keep(self, theta: Floats, zeta: float, basis: Floats) -> None:
        """Keep a basis (n, r) for theta (p,) and zeta."""
        write_arrays(self.study.path(_NEAR_FILE), basis=basis)
        settings, origin = {"size": basis.shape[1]}, self._origin(theta, zeta)
        self.study.record(NEAR_BASIS, _NEAR_FILE, "diagnose", origin, settings)

    def _origin(self, theta: Floats, zeta: float) -> dict[str, str]:
        return {
            **finder_origin(self.building),
            "theta": " ".join(f"{factor:.4g}" for factor in theta),
            "zeta": f"{zeta:.4g}",
        }
