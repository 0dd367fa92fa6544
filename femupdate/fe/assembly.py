"""From the model to sparse operators, affine in the stiffness parameters theta."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, identity

from femupdate.arrays import Flags, Floats, Indices, Integers
from femupdate.errors import StructureError
from femupdate.fe.links import link_expansion, slave_dof
from femupdate.fe.model import (
    CONSTANT,
    DOF_PER_NODE,
    Elements,
    FiniteElementModel,
    PointMasses,
    Springs,
    check_model,
)


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
    values = np.concatenate([masses.mass, masses.inertia.reshape(-1, 3)], axis=1).ravel()
    return Entries(dof, dof, values)


def summed(parts: Iterable[Entries], size: int) -> csc_matrix:
    """The (size, size) matrix that all entries add up to, without stored zeros."""
    rows, columns, values = zip(*((p.rows, p.columns, p.values) for p in parts), strict=True)
    where = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((np.concatenate(values), where), shape=(size, size)).tocsc()
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix.copy()  # without the room of all summands


@dataclass(frozen=True)
class AffineOperators:
    """Stiffness K(theta) = constant + sum_i theta_i terms[i] and mass of a supported structure."""

    # one (n_free, n_free) matrix per parameter, N/m, N and N m
    stiffness_terms: tuple[csc_matrix, ...]
    stiffness_constant: csc_matrix  # (n_free, n_free) part that no parameter scales
    mass: csc_matrix  # (n_free, n_free) consistent mass, kg, kg m and kg m2
    mass_full: csc_matrix  # (6N, 6N) mass before supports
    # (n_free,) indices of the independent degrees of freedom, ascending, into 6N: neither held nor
    # slaves of a rigid link
    free: Integers
    dof: int  # 6N
    model: FiniteElementModel
    # (6N, n_free) motion of all degrees of freedom per unit of the independent ones where there are
    # rigid links, None where all others are held
    expansion: csr_matrix | None = None

    @property
    def parameters(self) -> int:
        """Number of stiffness parameters p."""
        return len(self.stiffness_terms)

    def stiffness(self, theta: Floats) -> csc_matrix:
        """Stiffness matrix at theta (p,), (n_free, n_free).

        Raises:
            StructureError: theta has another length, or a value that is not finite.
        """
        theta = np.asarray(theta, dtype=float)
        if theta.shape != (self.parameters,) or not np.isfinite(theta).all():
            raise StructureError(
                f"theta must hold {self.parameters} finite values, one per stiffness parameter; "
                f"got {theta.tolist()}"
            )
        pattern, values = self.on_one_pattern
        return _on_pattern(values @ np.append(1.0, theta), pattern)

    @cached_property
    def on_one_pattern(self) -> tuple[csc_matrix, csr_matrix]:
        """Where the stiffness or the mass has an entry, and values (nnz, 1 + p) of its parts there.

        One order of elimination then suits K and K - w^2 M.
        """
        parts = (self.stiffness_constant, *self.stiffness_terms)
        pattern = _union((*parts, self.mass))
        return pattern, _placed(parts, pattern)

    def terms_of(self, chosen: Callable[[Elements], Flags]) -> tuple[csc_matrix, ...]:
        """The part that some elements have in the stiffness terms, without any springs."""

        def of(group: int) -> csc_matrix:
            model = self.model.mapped(
                lambda block: block.taken(np.flatnonzero(chosen(block) & (block.group == group)))
            )
            stiffness, _ = _entries(replace(model, springs=Springs()))
            return _onto(self.free, self.expansion, stiffness[group], self.dof)

        return tuple(map(of, range(self.parameters)))

    def expand(self, values: Floats) -> Floats:
        """Motion of all degrees of freedom, zero at the supports, (n_free, ...) -> (6N, ...)."""
        if self.expansion is not None:
            flat = self.expansion @ values.reshape(len(values), -1)
            return flat.reshape(self.dof, *values.shape[1:])
        full = np.zeros((self.dof, *values.shape[1:]), dtype=values.dtype)
        full[self.free] = values
        return full

    def gather(self, load: Floats) -> Floats:
        """Loads on the independent degrees of freedom, (6N, ...) -> (n_free, ...).

        What acts on the slaves of rigid links goes to their masters with its moment; what acts on
        supports is dropped. Rows that observe the motion are gathered in the same way.
        """
        if self.expansion is None:
            return load[self.free]
        flat = self.expansion.T @ load.reshape(len(load), -1)
        return flat.reshape(len(self.free), *load.shape[1:])

    def rigid_translation(self, direction: int) -> Floats:
        """Unit translation of all nodes along 0 (x), 1 (y) or 2 (z), (6N,)."""
        if direction not in (0, 1, 2):
            raise StructureError(f"direction {direction} is unknown; use 0 (ux), 1 (uy) or 2 (uz)")
        motion = np.zeros((self.dof // DOF_PER_NODE, DOF_PER_NODE))
        motion[:, direction] = 1.0
        return motion.ravel()

    def inertia(self, direction: int) -> Floats:
        """Inertia force per unit base acceleration along 0, 1 or 2, (n_free,), kg and kg m.

        The supports move too: consistent mass couples them with the free degrees of freedom.
        """
        return self.gather(self.mass_full @ self.rigid_translation(direction))


def assemble(model: FiniteElementModel) -> AffineOperators:
    """Assemble stiffness terms and mass of a model."""
    check_model(model)
    stiffness, mass = _entries(model)
    expansion = link_expansion(model)
    free = np.flatnonzero(~model.fixed.ravel())
    if expansion is not None:
        free = np.setdiff1d(free, slave_dof(model.links))
        expansion = expansion[:, free]
    # Their entries are given up with each matrix: together they take more room than all of these.
    groups = range(model.groups)
    terms = tuple(_onto(free, expansion, stiffness.pop(group), model.dof) for group in groups)
    mass_full = summed(mass, model.dof)
    return AffineOperators(
        stiffness_terms=terms,
        stiffness_constant=_onto(free, expansion, stiffness.pop(CONSTANT), model.dof),
        mass=mass_full[free][:, free] if expansion is None else _congruent(expansion, mass_full),
        mass_full=mass_full,
        free=free,
        dof=model.dof,
        model=model,
        expansion=expansion,
    )


def _onto(
    free: Integers, expansion: csr_matrix | None, parts: list[Entries], dof: int
) -> csc_matrix:
    """The matrix that entries (6N, 6N) add up to, for the independent degrees of freedom."""
    if expansion is not None:
        return _congruent(expansion, summed(parts, dof))
    number = np.full(dof, -1, dtype=np.int32)
    number[free] = np.arange(len(free))
    return summed([part.renumbered(number) for part in parts], len(free))


def _congruent(expansion: csr_matrix, matrix: csc_matrix) -> csc_matrix:
    """T^T A T, symmetric to the last digit and without stored zeros."""
    product = (expansion.T @ matrix @ expansion).tocsc()
    product = (0.5 * (product + product.T)).tocsc()
    product.eliminate_zeros()
    product.sort_indices()
    return product


def _entries(model: FiniteElementModel) -> tuple[dict[int, list[Entries]], list[Entries]]:
    """Entries of stiffness by parameter, -1 for what none scales, and of mass."""
    stiffness: dict[int, list[Entries]] = {group: [] for group in range(-1, model.groups)}
    mass = []
    for block in model.elements:
        for some, matrices in block.matrices_in_parts(model.nodes):
            nodes, groups = block.nodes[some], block.group[some]
            mass.append(element_entries(nodes, matrices.mass))
            for group in np.unique(groups):
                chosen = groups == group
                shared = len(matrices.stiffness) == 1
                values = matrices.stiffness if shared else matrices.stiffness[chosen]
                part = element_entries(nodes[chosen], values)
                stiffness[max(int(group), CONSTANT)].append(part)
    for group, parts in stiffness.items():
        springs = model.springs.group
        parts.append(spring_entries(model.springs, springs == group if group >= 0 else springs < 0))
    return stiffness, [*mass, mass_entries(model.masses)]


def _union(matrices: tuple[csc_matrix, ...]) -> csc_matrix:
    """A matrix that has an entry wherever one of the given has one, and on its diagonal."""
    diagonal = identity(matrices[0].shape[0], format="csc")
    pattern = reduce(lambda left, right: left + abs(right), matrices, diagonal).tocsc()
    pattern.sort_indices()
    return pattern


def _placed(matrices: tuple[csc_matrix, ...], pattern: csc_matrix) -> csr_matrix:
    """Values of matrices on a pattern that holds the entries of all of them, (nnz, p)."""
    known = _keys(pattern)
    where = [np.searchsorted(known, _keys(matrix)) for matrix in matrices]
    starts = np.cumsum([0, *map(len, where)])
    values = np.concatenate([matrix.data for matrix in matrices])
    shape = pattern.nnz, len(matrices)
    return csc_matrix((values, np.concatenate(where), starts), shape=shape).tocsr()


def _keys(matrix: csc_matrix) -> Integers:
    """Number of each entry, ascending, column by column."""
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    return columns * matrix.shape[0] + matrix.indices


def _on_pattern(values: Floats, pattern: csc_matrix) -> csc_matrix:
    """A matrix with given values that shares the index arrays of another."""
    matrix = csc_matrix((values, pattern.indices, pattern.indptr), shape=pattern.shape, copy=False)
    matrix.has_sorted_indices = True
    matrix.has_canonical_format = True
    return matrix
