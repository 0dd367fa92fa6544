"""A building as the effect finder needs it: its structures, the error of its mesh, its bases."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building.document import Building, without_effects
from femupdate.building.frame import FrameBuilding
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.near_basis import Bases
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.dynamics.damping import damping_law
from femupdate.dynamics.force_response import rest_about
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure, lumped
from femupdate.dynamics.system import System
from femupdate.effects.structure import Structure, require_story_factors, structure_of
from femupdate.errors import BuildingError
from femupdate.inference.data import Data
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Likelihood, likelihood_of
from femupdate.inference.parameters import Parameters, damping_parameter, theta_prior


@dataclass(frozen=True, eq=False)
class FinderModel:
    """What serves every observation of a building.

    Attributes:
        building: as its file says.
        plain: the structure on the building's own basis, which knows the story factors alone.
        structure: the full model in which effects act.
        mesh: error of its mesh where it is a frame's, or None.
        bases: keeps the basis near a fit; None keeps none.
    """

    building: Building
    plain: ReducedStructure
    structure: Structure
    mesh: MeshError | None = None
    bases: Bases | None = None


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


def plain_structure(building: Building, reduced: ReducedModel) -> ReducedStructure:
    """The structure on the basis of a reduced model, which knows the story factors alone."""
    require_story_factors(building)
    structure = structure_of(without_effects(building))
    if structure.is_stick:
        return lumped(structure)
    return ReducedStructure(structure, reduced, np.zeros((len(structure.axis), 0)))


def problem_of(reduced: ReducedStructure, building: Building, data: Sequence[Data]) -> Likelihood:
    """A building and what was observed of it, for the effect finder."""
    system = System(reduced.model, damping_law(building))
    prior = theta_prior(building) + Parameters((damping_parameter(building),))
    return likelihood_of(data, system, prior, reduced=reduced)


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


def with_rest_about(
    data: Sequence[Data], structure: Structure, reduced: ReducedModel, theta: Floats
) -> tuple[Data, ...]:
    """The data with what a basis about theta (p,) lacks under forces; that of a stick nothing."""
    forced = any(isinstance(one, FrfData) and one.forced for one in data)
    if structure.operators is None or not forced:
        return tuple(data)
    rest = rest_about(structure, reduced, theta)
    return tuple(one.with_rest(rest) if isinstance(one, FrfData) else one for one in data)
