"""A reduced model carried over to a finer mesh of the same building, for all its parameters.

The responses from which a basis is taken are known from the coarse mesh. Their inertial forces,
brought to the finer mesh, move it by nearly the right shapes: one static solution takes the place
of a whole eigenproblem, and what the coarse mesh has wrong is of higher modes, of which it leaves
little (inverse iteration; Bathe 2014, Finite Element Procedures, section 11.2). The Galerkin
projection of the finer mesh on these shapes does the rest.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags, eye_array

from femupdate.arrays import Floats, Singles
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure, reduced_on
from femupdate.dynamics.reduction import Space
from femupdate.dynamics.snapshots import STATIC_WEIGHT, FeltModes, ReductionTarget, compressed
from femupdate.effects.structure import ACROSS, TRANSLATION, Structure
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.products import combined
from femupdate.progress import SILENT, Progress
from femupdate.workers import in_threads

_DIGITS = 6  # decimals of a metre in which lines of two meshes are the same
# Shapes, over those of the coarse mesh: of the six-story frame, read back from a deck, posterior
# means moved by .17 sd with as many, by .14 with 1.15 times, .07 with 1.22, and .04 with 1.3 times,
# when the demo took a fifth more processor time.
_SHAPES = 1.22


def on_finer_mesh(
    coarse: Structure,
    reduced: ReducedModel,
    fine: Structure,
    target: ReductionTarget,
    thetas: Floats,
    progress: Progress = SILENT,
) -> ReducedStructure:
    """Return the structure of a finer mesh on more shapes than the coarse one has.

    Args:
        coarse: the building on its mesh.
        reduced: of it, with the displacement of its nodes.
        fine: the building on a finer mesh.
        target: what `reduced` reproduces.
        thetas: (n, p) at which the finer mesh is solved.
    """
    progress.start("Carrying the model over to a finer mesh", len(thetas))
    assert reduced.node_shapes is not None
    columns = [TRANSLATION] if reduced.across is None else [TRANSLATION, ACROSS]
    weights = [weight for weight, _ in reduced.driving]
    static = STATIC_WEIGHT * fine.rigid_force[:, columns] * weights
    held = STATIC_WEIGHT * fine.dashpot_forces.T  # which lag behind what floors do
    loads = _loads(coarse, reduced.node_shapes, fine)
    # Inside of the parts half of the shapes, those that count most, do: with all of 230 ln|H| of
    # the six-story frame differs by 6e-6 (rms).
    space = Space.of_forces(fine, np.column_stack([loads[:, : reduced.size // 2], static, held]))
    forces = space.condensed(np.column_stack([loads, static, held]))
    task = partial(_moved, space, reduced, forces, target)
    shapes = in_threads(task, list(thetas), progress)
    size = round(_SHAPES * reduced.size)
    basis = space.expanded(compressed(space.mass, shapes, size))
    return reduced_on(fine, basis, crosses=reduced.across is not None)


def on_nodes_of(coarse: Structure, reduced: ReducedStructure) -> ReducedModel:
    """The reduced model of a split mesh, whose first nodes those of the coarse one are."""
    shapes = reduced.model.node_shapes
    assert shapes is not None
    return replace(reduced.model, node_shapes=shapes[: len(_nodes(coarse))])


def interpolation(known: Floats, wanted: Floats) -> csr_matrix:
    """Weights (m, n) of n known nodes at m wanted points, linear between the lines of a lattice.

    Args:
        known: (n, 3) on crossings of a lattice's lines, not all of which need be there.
        wanted: (m, 3) points.
    """
    known, wanted = np.round(known, _DIGITS), np.round(wanted, _DIGITS)
    if np.array_equal(known, wanted):
        return csr_matrix(eye_array(len(known)))
    lines = [np.unique(known[:, axis]) for axis in range(3)]
    shape = tuple(len(line) for line in lines)
    number = np.full(shape, -1)
    places = (np.searchsorted(line, known[:, axis]) for axis, line in enumerate(lines))
    number[tuple(places)] = np.arange(len(known))
    pairs = [_between(line, wanted[:, axis]) for axis, line in enumerate(lines)]
    total = csr_matrix((len(wanted), len(known)))
    for corner in np.ndindex(2, 2, 2):
        chosen = [pair[end] for pair, end in zip(pairs, corner, strict=True)]
        weight = np.prod([share for _, share in chosen], axis=0)
        column = number[tuple(place for place, _ in chosen)]
        rows = np.flatnonzero((weight > 0.0) & (column >= 0))
        total = total + csr_matrix((weight[rows], (rows, column[rows])), shape=total.shape)
    # Where a crossing is empty the others stand in for it.
    sums = np.asarray(total.sum(axis=1))[:, 0]
    return csr_matrix(diags(1.0 / np.where(sums > 0.0, sums, 1.0)) @ total)


def _between(
    line: Floats, values: Floats
) -> tuple[tuple[NDArray[np.intp], Floats], tuple[NDArray[np.intp], Floats]]:
    """The places (m,) below and above values (m,) on a sorted line, each with its share."""
    if len(line) == 1:
        place = np.zeros(len(values), dtype=np.intp)
        return (place, np.ones(len(values))), (place, np.zeros(len(values)))
    below = np.clip(np.searchsorted(line, values, side="right") - 1, 0, len(line) - 2)
    share = np.clip((values - line[below]) / (line[below + 1] - line[below]), 0.0, 1.0)
    return (below, 1.0 - share), (below + 1, share)


def _nodes(structure: Structure) -> Floats:
    return structure.meshed[0].model.nodes


def _loads(coarse: Structure, shapes: NDArray[np.float32], fine: Structure) -> Floats:
    """Inertial forces (n, r) on the finer mesh per unit acceleration of each coarse shape."""
    mesh, operators = fine.meshed
    nodes = mesh.model.nodes
    between = mesh.of_coarser
    if between is None:
        between = interpolation(_nodes(coarse), nodes)
    forces = np.zeros((operators.mass_full.shape[0], shapes.shape[2]))
    for axis in range(3):
        moved = between @ shapes[:, axis].astype(np.float64)
        forces += operators.mass_full[axis::DOF_PER_NODE].T @ moved
    return operators.gather(forces)


def _moved(
    space: Space, reduced: ReducedModel, forces: Floats, target: ReductionTarget, theta: Floats
) -> Singles:
    """Weighted shapes (q, c) of the finer mesh at a theta (p,), to take a basis from.

    Args:
        forces: (q, r + s) of the coarse shapes' inertia, then those whose own shapes are wanted.
    """
    squared, vectors = np.linalg.eigh(reduced.stiffness(theta))
    omega, floors = np.sqrt(np.maximum(squared, 0.0)), reduced.floor_shapes @ vectors
    dashpots = None if reduced.dashpots is None else reduced.dashpots @ vectors
    # Responses of less energy, of the largest, are left out.
    weights = [
        FeltModes(omega, scale * force @ vectors, floors, dashpots).combinations(target, 1e-5)
        for scale, force in reduced.driving
    ]
    inertia, others = np.hsplit(forces, [reduced.size])
    moving = combined(inertia, (vectors * squared) @ np.column_stack(weights))
    return space.at(theta).apply(np.column_stack([moving, others])).astype(np.float32)
