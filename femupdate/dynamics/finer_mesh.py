"""A reduced model carried over to a finer mesh of the same building, for all its parameters.

The responses from which a basis is taken are known from the coarse mesh. Their inertial forces,
brought to the finer mesh, move it by nearly the right shapes: one static solution takes the place
of a whole eigenproblem, and what the coarse mesh has wrong is of higher modes, of which it leaves
little (inverse iteration; Bathe 2014, Finite Element Procedures, section 11.2). The Galerkin
projection of the finer mesh on these shapes does the rest.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags, eye_array

from femupdate.arrays import Floats
from femupdate.building.building_mesh import BuildingMesh
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure, reduced_on
from femupdate.dynamics.reduction import Space, moved_by
from femupdate.dynamics.snapshots import STATIC_WEIGHT, ReductionTarget, compressed
from femupdate.effects.structure import ACROSS, TRANSLATION, Structure
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.products import symmetric_times
from femupdate.progress import SILENT, Progress
from femupdate.workers import in_threads, return_memory

_DIGITS = 6  # decimals of a metre in which lines of two meshes are the same
# Shapes, over those of the coarse mesh: of the six-story frame, read back from a deck, posterior
# means moved by .17 sd with as many, by .14 with 1.15 times, .07 with 1.22, and .04 with 1.3 times,
# when the demo took a fifth more processor time.
_SHAPES = 1.22
_AT_ONCE = 32  # shapes, or all of them on all nodes would fill gigabytes


def on_finer_mesh(
    coarse: BuildingMesh,
    reduced: ReducedModel,
    fine: Structure,
    target: ReductionTarget,
    thetas: Floats,
    progress: Progress = SILENT,
) -> ReducedStructure:
    """Return the structure of a finer mesh on more shapes than the coarse one has.

    Args:
        coarse: the building's own mesh.
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
    # Inside of the parts half of the shapes, those that count most, do: with all of 230 ln|H| of
    # the six-story frame differs by 6e-6 (rms).
    loads = _loads(coarse, reduced.node_shapes[:, :, : reduced.size // 2], fine)
    space = Space.of_forces(fine, np.column_stack([*loads, static, held]))
    inertia = [space.condensed(some) for some in _loads(coarse, reduced.node_shapes, fine)]
    others = space.condensed(np.column_stack([static, held]))
    forces = np.column_stack([*inertia, others])
    task = partial(moved_by, space, reduced, forces, target)
    shapes = in_threads(task, list(thetas), progress)
    size = round(_SHAPES * reduced.size)
    basis = space.expanded(compressed(space.mass, shapes, size))
    del loads, space, inertia, forces, task, shapes  # for a basis that fills gigabytes
    return_memory()
    return reduced_on(fine, basis, crosses=reduced.across is not None)


def on_nodes_of(coarse: BuildingMesh, reduced: ReducedStructure) -> ReducedModel:
    """The reduced model of a split mesh, whose first nodes those of the coarse one are."""
    shapes = reduced.model.node_shapes
    assert shapes is not None
    return replace(reduced.model, node_shapes=shapes[: len(coarse.model.nodes)].copy())


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


def _loads(coarse: BuildingMesh, shapes: NDArray[np.float32], fine: Structure) -> Iterator[Floats]:
    """Inertial forces (n, c) on the finer mesh per unit acceleration of coarse shapes (N, 3, r)."""
    mesh, operators = fine.meshed
    nodes = mesh.model.nodes
    between = mesh.of_coarser
    if between is None:
        between = interpolation(coarse.model.nodes, nodes)
    for start in range(0, shapes.shape[2], _AT_ONCE):
        some = shapes[:, :, start : start + _AT_ONCE].astype(np.float64)
        moved = np.zeros((len(nodes), DOF_PER_NODE, some.shape[2]))
        moved[:, :3] = (between @ some.reshape(len(some), -1)).reshape(len(nodes), 3, -1)
        forces = symmetric_times(operators.mass_full, moved.reshape(operators.dof, -1))
        yield operators.gather(forces)
