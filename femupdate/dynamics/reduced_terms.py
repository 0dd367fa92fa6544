"""What effects add to a reduced model."""

from dataclasses import dataclass, field, replace

import numpy as np
import torch
from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.effect import (
    UNSCALED,
    AddedMass,
    Array,
    Hinges,
    Placed,
    Port,
    Stiffness,
    Terms,
)
from femupdate.effects.structure import Structure

# The matrix is kept with its projection, so that no other takes its identity.
Projections = dict[int, tuple[csc_matrix, Tensor]]


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """A structure seen through a mass-orthonormal basis of r shapes.

    Attributes:
        structure: the full model.
        model: its reduced model.
        basis: (n, r) the shapes.
        known: what effects add, by label, once it was asked for.
        matrices: what `projected` makes of those that several effects share, by their identity.
        whole: the structure on more shapes whose first these are, or None.
    """

    structure: Structure
    model: ReducedModel
    basis: Floats
    known: dict[str, Terms] = field(default_factory=dict, repr=False)
    matrices: Projections = field(default_factory=dict, repr=False)
    whole: "ReducedStructure | None" = None

    def terms(self, placed: Placed) -> Terms:
        """What an effect adds."""
        if placed.label not in self.known:
            if self.whole is not None:
                added = first_coordinates(self.whole.terms(placed), self.model.size)
            else:
                whole = placed.effect.terms(self.structure, placed.place)
                added = reduce_terms(self.basis, whole, self.matrices)
            self.known[placed.label] = added
        return self.known[placed.label]

    def first(self, count: int) -> "ReducedStructure":
        """The structure on the first shapes of its basis, which count most."""
        if count >= self.model.size:
            return self
        return replace(
            self,
            model=self.model.first(count),
            basis=self.basis[:, :count],
            known={},
            matrices={},
            whole=self,
        )


def first_coordinates(terms: Terms, count: int) -> Terms:
    """What an effect adds to the first coordinates of a reduced model."""
    mass, port, hinges, own = terms.mass, terms.port, terms.hinges, slice(count)
    return replace(
        terms,
        stiffness=tuple(one._replace(matrix=one.matrix[own, own]) for one in terms.stiffness),
        hinges=None if hinges is None else replace(hinges, coupling=hinges.coupling[:, own]),
        mass=None
        if mass is None
        else replace(
            mass,
            matrix=mass.matrix[own, own],
            force=mass.force[own],
            above=mass.above[:, own],
        ),
        port=None if port is None else replace(port, row=port.row[own]),
    )


def projected(basis: Floats, matrix: csc_matrix) -> Floats:
    """basis^T matrix basis (r, r), through the rows in which the matrix has numbers."""
    by_row = matrix.tocsr(copy=True)
    by_row.eliminate_zeros()
    rows = np.flatnonzero(np.diff(by_row.indptr))
    own = basis[rows]
    result = own.T @ (by_row[rows][:, rows] @ own)
    return 0.5 * (result + result.T)


def along(rows: Array, basis: Floats) -> Floats:
    """rows basis (c, r), by the columns of the rows (c, n) in which there are numbers."""
    whole = np.asarray(rows)
    used = np.flatnonzero(whole.any(axis=0))
    return np.asarray(whole[:, used] @ basis[used])


def reduce_terms(basis: Floats, terms: Terms, matrices: Projections | None = None) -> Terms:
    """Project what an effect adds onto a basis (n, r): its terms in r coordinates, as tensors.

    Args:
        matrices: those that were projected already; gets the new ones.
    """
    done = {} if matrices is None else matrices

    def once(matrix: csc_matrix) -> Tensor:
        if id(matrix) not in done:
            done[id(matrix)] = matrix, torch.from_numpy(projected(basis, matrix))
        return done[id(matrix)][1]

    port = None
    if terms.port is not None:
        line = along(terms.port.row[None], basis)[0]
        port = Port(torch.from_numpy(line), torch.as_tensor(terms.port.rigid))
    stiffness = [Stiffness(one.story, once(one.matrix), one.series) for one in terms.stiffness]
    if terms.springs is not None:
        stretch = along(terms.springs.rows, basis)  # (c, r)
        own = stretch.T @ (terms.springs.stiffness[:, None] * stretch)
        stiffness.append(Stiffness(UNSCALED, torch.from_numpy(0.5 * (own + own.T))))
    return Terms(
        stiffness=tuple(stiffness),
        hinges=None if terms.hinges is None else _reduced_hinges(basis, terms.hinges),
        mass=None if terms.mass is None else _reduced_mass(basis, terms.mass),
        flexibility=terms.flexibility,
        pitch=terms.pitch,
        port=port,
        constants=terms.constants,
    )


def _reduced_hinges(basis: Floats, hinges: Hinges) -> Hinges:
    coupling = np.stack([along(own.T, basis).T for own in hinges.coupling])
    return Hinges(*(torch.as_tensor(part) for part in (coupling, hinges.inner, hinges.spring)))


def _reduced_mass(basis: Floats, mass: AddedMass) -> AddedMass:
    parts = (
        projected(basis, mass.matrix),
        along(mass.force.T, basis).T,
        mass.rigid,
        along(mass.above, basis),
        mass.above_rigid,
    )
    return AddedMass(*(torch.from_numpy(np.asarray(part)) for part in parts))
