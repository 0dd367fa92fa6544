"""A structure on a basis: the Galerkin projection that every reduced model is."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.dynamics.reduced import BaseRotation, ReducedModel
from femupdate.dynamics.reduced_terms import ReducedStructure, projected
from femupdate.dynamics.released import released_base
from femupdate.effects.structure import ROTATION, TRANSLATION, Structure
from femupdate.fe.model import DOF_PER_NODE


def lumped(structure: Structure) -> ReducedStructure:
    """A stick as it is, in coordinates of unit mass."""
    terms = np.stack([term.toarray() for term in structure.stiffness_terms])
    mass = structure.mass.toarray()
    model = reduce_lumped(terms, mass, structure.floors, structure.levels)
    model = replace(model, released=released_base(structure))
    return ReducedStructure(structure, model, np.diag(np.diag(mass) ** -0.5))


def reduce_lumped(
    stiffness_terms: Floats, mass: Floats, floors: tuple[str, ...], levels: Floats | None = None
) -> ReducedModel:
    """A shear building as a reduced model; nothing is left out.

    Args:
        stiffness_terms: (p, n, n), N/m, in displacements relative to the base.
        mass: (n, n) diagonal, kg.
        floors: n names, bottom to top.
        levels: (n,) heights of the floors, m; one a story where None.
    """
    masses, count = np.diag(mass), len(mass)
    heights = np.arange(1.0, count + 1.0) if levels is None else levels
    basis = np.diag(masses**-0.5)
    rigid = np.column_stack([np.ones(count), heights])
    above = np.triu(np.ones((count, count))) * masses  # row i: floors above story i
    return ReducedModel(
        stiffness_terms=basis.T @ stiffness_terms @ basis,
        stiffness_constant=np.zeros((count, count)),
        excitation=basis.T @ masses,
        floor_shapes=basis.copy(),
        floors=floors,
        story_inertia=above @ basis,
        story_mass=above.sum(axis=1),
        story_drift=(np.eye(count) - np.eye(count, k=-1)) @ basis,
        rotation=BaseRotation(
            force=basis.T @ (masses * heights),
            mass=rigid.T @ (masses[:, None] * rigid),
            story_moment=above @ heights,
            levels=heights,
        ),
    )


def reduced_on(structure: Structure, basis: Floats) -> ReducedStructure:
    """A structure seen through a mass-orthonormal basis (n, r)."""
    floors, force = structure.floor_rows @ basis, basis.T @ structure.rigid_force
    rigid = structure.story_rigid
    model = ReducedModel(
        stiffness_terms=np.stack([projected(basis, term) for term in structure.stiffness_terms]),
        stiffness_constant=projected(basis, structure.stiffness_constant),
        excitation=force[:, TRANSLATION],
        floor_shapes=floors,
        floors=structure.floors,
        story_inertia=structure.story_inertia @ basis,
        story_mass=rigid[:, TRANSLATION],
        story_drift=np.diff(floors, axis=0, prepend=np.zeros((1, basis.shape[1]))),
        node_shapes=_node_shapes(structure, basis),
        rotation=BaseRotation(
            force=force[:, ROTATION],
            mass=structure.rigid_mass,
            story_moment=rigid[:, ROTATION],
            levels=structure.levels,
        ),
        released=released_base(structure),
    )
    return ReducedStructure(structure, model, basis)


def _node_shapes(structure: Structure, basis: Floats) -> NDArray[np.float32] | None:
    if structure.operators is None:
        return None
    full = structure.operators.expand(basis).reshape(-1, DOF_PER_NODE, basis.shape[1])
    return full[:, :3].astype(np.float32)
