"""A reduced structure on which effects can act: a basis that knows more than the story factors."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.effect_response import ReducedStructure
from femupdate.dynamics.effect_samples import VariedShapes, variation_of
from femupdate.dynamics.full_response import floor_sensors
from femupdate.dynamics.reduced import ReducedModel
from femupdate.dynamics.reduction import (
    ReductionTarget,
    project,
    reduce_lumped,
    response_basis,
)
from femupdate.effects.structure import Structure
from femupdate.fe.assembly import with_terms
from femupdate.progress import SILENT, Progress

_SIZE = 220


def reduce_structure(
    structure: Structure,
    target: ReductionTarget,
    progress: Progress = SILENT,
) -> ReducedStructure:
    """Reduce a structure for use with effects.

    The snapshots are taken at random story factors, factors on each kind of member, shares of what
    walls without stiffness could give, and eccentricities. A stick is its own reduction.

    Args:
        structure: the full model.
        target: box, grid and damping.
        progress: a bar of full solutions.
    """
    if structure.operators is None or structure.mesh is None:
        return structure_on(structure, np.diag(structure.points.mass**-0.5))
    varied = variation_of(structure)
    operators = with_terms(structure.operators, varied.terms)
    sensors = floor_sensors(operators, structure.mesh.floor_nodes, structure.direction)
    draws = varied.draw(target.lower, target.upper, target.samples, target.seed)
    progress.start("Reducing the model for effects", len(draws))
    task = VariedShapes(varied.mass)
    basis = response_basis(operators, sensors, draws, target, progress, task=task, size=_SIZE)
    return structure_on(structure, basis)


def structure_on(structure: Structure, basis: Floats) -> ReducedStructure:
    """A structure seen through a mass-orthonormal basis (n, r)."""
    if structure.operators is None or structure.mesh is None:
        model = _stick_model(structure)
    else:
        operators, nodes = structure.operators, structure.mesh.floor_nodes
        levels = np.concatenate([[0.0], structure.levels])
        sensors = floor_sensors(operators, nodes, structure.direction)
        model = project(operators, basis, nodes, levels, sensors)
    return ReducedStructure(structure, model, basis, basis.T @ structure.rigid_force)


def _stick_model(structure: Structure) -> ReducedModel:
    terms = np.stack([term.toarray() for term in structure.stiffness_terms])
    return reduce_lumped(terms, structure.mass.toarray(), structure.floors)
