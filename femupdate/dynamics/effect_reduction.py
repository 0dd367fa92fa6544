"""A reduced structure on which effects can act: a basis that knows more than the story factors."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.stats import qmc

from femupdate.dynamics.effect_response import ReducedStructure
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

Floats = NDArray[np.float64]
_SIZE = 220
_MEMBERS = (0.3, 1.6)  # range of the factor on one kind of member
_KINDS = (("wall",), ("beam",), ("column",), ("slab",))


def reduce_structure(
    structure: Structure,
    target: ReductionTarget,
    progress: Callable[[int, int], None] | None = None,
) -> ReducedStructure:
    """Reduce a structure for use with effects.

    The snapshots are taken at random story factors and factors on each kind of member, under base
    translation, base rotation, forces on the floors, and inertia forces across them, so that
    effects stay near the span of the basis. A stick is its own reduction.

    Args:
        structure: the full model.
        target: box, grid and damping.
        progress: told (done, total).
    """
    if structure.operators is None or structure.mesh is None:
        return structure_on(structure, np.diag(structure.points.mass**-0.5))
    operators = with_terms(structure.operators, _member_terms(structure))
    sensors = floor_sensors(operators, structure.mesh.floor_nodes, structure.direction)
    thetas = _samples(structure, target)
    basis = response_basis(
        operators, replace(sensors, others=_other_forces(structure)), thetas, target, progress
    )[:, :_SIZE]
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


def _member_terms(structure: Structure) -> tuple[csc_matrix, ...]:
    """Stiffness of each kind of member, and of the rest, of the first story, the second, ..."""
    members = [structure.member_stiffness(kinds, False) for kinds in _KINDS]
    by_story = zip(structure.stiffness_terms, *members, strict=True)
    return tuple(
        matrix
        for whole, *kinds in by_story
        for matrix in (*kinds, csc_matrix(whole - sum(kinds[1:], start=kinds[0])))
    )


def _samples(structure: Structure, target: ReductionTarget) -> Floats:
    """(n, 5 p) factors on the terms: the story's times the kind's, the rest's being 1."""
    stories = len(target.lower)
    sobol = qmc.Sobol(stories + len(_KINDS), seed=np.random.default_rng(target.seed))
    power = max(target.samples - 1, 0).bit_length()
    unit = sobol.random_base2(power)[: target.samples]
    low, high = np.log(target.lower), np.log(target.upper)
    theta = np.exp(low + (high - low) * unit[:, :stories])
    least, most = np.log(_MEMBERS)
    kind = np.exp(least + (most - least) * unit[:, stories:])
    kind = np.column_stack([kind, np.ones(len(unit))])
    return (theta[:, :, None] * kind[:, None, :]).reshape(len(unit), -1)


def _other_forces(structure: Structure) -> Floats:
    """(2, n) inertia forces of base rotation, and across the floors, of the size of the first."""
    points = structure.points
    across = points.position[:, 1 - structure.direction]
    along = points.axis == structure.direction
    twist = points.motion.T @ np.where(along, points.mass * (across - across.mean()), 0.0)
    forces = np.stack([structure.rigid_force[:, 1], twist])
    norm = np.linalg.norm(structure.rigid_force[:, 0])
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    return forces * (norm / np.where(sizes > 0.0, sizes, 1.0))


def _stick_model(structure: Structure) -> ReducedModel:
    terms = np.stack([term.toarray() for term in structure.stiffness_terms])
    return reduce_lumped(terms, structure.mass.toarray(), structure.floors)
