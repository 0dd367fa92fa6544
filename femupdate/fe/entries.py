"""Entries of the global matrices: element matrices scattered to the degrees of freedom."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

from femupdate.arrays import Flags, Floats, Indices, Integers
from femupdate.fe.model import DOF_PER_NODE, PointMasses, Springs


@dataclass(frozen=True)
class Entries:
    """Summands of a sparse matrix: rows, columns and values, (m,) each."""

    rows: Indices
    columns: Indices
    values: Floats

    def renumbered(self, number: Indices) -> "Entries":
        """Replace the indices by `number[index]` and drop what becomes negative."""
        rows, columns = number[self.rows], number[self.columns]
        keep = (rows >= 0) & (columns >= 0)
        return Entries(rows[keep], columns[keep], self.values[keep])


def element_entries(nodes: Integers, matrices: Floats) -> Entries:
    """Entries of element matrices, (n, k) node indices and (n, 6k, 6k), or one for all."""
    dof = (DOF_PER_NODE * nodes[:, :, None] + np.arange(DOF_PER_NODE)).astype(np.int32)
    dof = dof.reshape(len(nodes), matrices.shape[1])
    if len(matrices) == 1:
        row, column = np.nonzero(matrices[0])
        values = np.tile(matrices[0, row, column], len(nodes))
        return Entries(dof[:, row].ravel(), dof[:, column].ravel(), values)
    there = matrices != 0.0
    rows = np.broadcast_to(dof[:, :, None], matrices.shape)[there]
    columns = np.broadcast_to(dof[:, None, :], matrices.shape)[there]
    return Entries(rows, columns, matrices[there])


def spring_entries(springs: Springs, chosen: Flags) -> Entries:
    """Entries of the chosen springs, to the ground and between two nodes."""
    dof = (DOF_PER_NODE * springs.nodes + springs.direction[:, None])[chosen].astype(np.int32)
    linked = springs.nodes[chosen, 1] >= 0
    first, (left, right) = dof[:, 0], dof[linked].T
    k = springs.stiffness[chosen]
    rows = np.concatenate([first, right, left, right])
    columns = np.concatenate([first, right, right, left])
    return Entries(rows, columns, np.concatenate([k, k[linked], -k[linked], -k[linked]]))


def mass_entries(masses: PointMasses) -> Entries:
    """Entries of masses and rotary inertias at nodes."""
    dof = (DOF_PER_NODE * masses.node[:, None] + np.arange(DOF_PER_NODE)).ravel().astype(np.int32)
    translation = np.repeat(masses.mass[:, None], 3, axis=1)
    values = np.concatenate([translation, masses.inertia.reshape(-1, 3)], axis=1).ravel()
    return Entries(dof, dof, values)


def summed(parts: Iterable[Entries], size: int) -> csc_matrix:
    """The (size, size) matrix that all entries add up to, without stored zeros."""
    rows, columns, values = zip(*((p.rows, p.columns, p.values) for p in parts), strict=True)
    where = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((np.concatenate(values), where), shape=(size, size)).tocsc()
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix
