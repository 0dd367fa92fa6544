"""What effects add to a reduced model."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import torch
from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.effect import UNSCALED, AddedMass, Hinges, Placed, Terms
from femupdate.effects.structure import Structure


@dataclass(frozen=True, eq=False)
class ReducedMass:
    """Mass of an effect of unit size in r reduced coordinates.

    Attributes:
        matrix: (r, r).
        force: (r, 2) per unit acceleration of base translation and rotation.
        rigid: (2, 2) by the rigid motions on both sides.
        above: (s, r) force of inertia of its part above each story, per unit acceleration.
        above_rigid: (s, 2) the same per unit acceleration of the base.
    """

    matrix: Tensor
    force: Tensor
    rigid: Tensor
    above: Tensor
    above_rigid: Tensor


@dataclass(frozen=True, eq=False)
class ReducedHinges:
    """`Hinges` of an effect in r reduced coordinates.

    Attributes:
        coupling: (p, r, j).
        inner: (p, j, j).
        spring: (j,).
    """

    coupling: Tensor
    inner: Tensor
    spring: Tensor

    def softening(self, theta: Tensor, size: Tensor) -> Tensor:
        """Stiffness (N, r, r) that hinges of sizes (N,) take away at theta (N, p)."""
        coupling = torch.einsum("np,prj->nrj", theta, self.coupling.to(theta))
        inner = torch.einsum("np,pij->nij", theta, self.inner.to(theta))
        inner = torch.diag(self.spring.to(theta)) + size[:, None, None] * inner
        return size[:, None, None] * (coupling @ torch.linalg.solve(inner, coupling.mT))


class ReducedStiffness(NamedTuple):
    """`Stiffness` of an effect in r reduced coordinates, the matrix (r, r)."""

    story: int
    matrix: Tensor
    series: float = 0.0


@dataclass(frozen=True, eq=False)
class ReducedTerms:
    """`Terms` of an effect as a reduced model has them (r coordinates)."""

    stiffness: tuple[ReducedStiffness, ...] = ()
    hinges: ReducedHinges | None = None
    mass: ReducedMass | None = None
    flexibility: tuple[float, float] = (0.0, 0.0)
    pitch: float = 0.0
    port: tuple[Tensor, Tensor] | None = None
    constants: tuple[float, ...] = ()

    @property
    def shapeless(self) -> bool:
        """Whether nothing is added to the structure, so that any basis serves the effect."""
        nothing = not self.stiffness and self.mass is None and self.port is None
        nothing = nothing and self.hinges is None
        return nothing and self.flexibility == (0.0, 0.0) and self.pitch == 0.0

    def first(self, count: int) -> "ReducedTerms":
        """The same in the first coordinates."""
        mass, port, hinges, own = self.mass, self.port, self.hinges, slice(count)
        return replace(
            self,
            stiffness=tuple(one._replace(matrix=one.matrix[own, own]) for one in self.stiffness),
            hinges=None if hinges is None else replace(hinges, coupling=hinges.coupling[:, own]),
            mass=None
            if mass is None
            else replace(
                mass,
                matrix=mass.matrix[own, own],
                force=mass.force[own],
                above=mass.above[:, own],
            ),
            port=None if port is None else (port[0][own], port[1]),
        )


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
    known: dict[str, ReducedTerms] = field(default_factory=dict, repr=False)
    matrices: Projections = field(default_factory=dict, repr=False)
    whole: "ReducedStructure | None" = None

    def terms(self, placed: Placed) -> ReducedTerms:
        """What an effect adds."""
        if placed.label not in self.known:
            if self.whole is not None:
                added = self.whole.terms(placed).first(self.model.size)
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


def projected(basis: Floats, matrix: csc_matrix) -> Floats:
    """basis^T matrix basis (r, r), through the rows in which the matrix has numbers."""
    by_row = matrix.tocsr(copy=True)
    by_row.eliminate_zeros()
    rows = np.flatnonzero(np.diff(by_row.indptr))
    own = basis[rows]
    result = own.T @ (by_row[rows][:, rows] @ own)
    return 0.5 * (result + result.T)


def along(rows: Floats, basis: Floats) -> Floats:
    """rows basis (c, r), by the columns of the rows (c, n) in which there are numbers."""
    used = np.flatnonzero(rows.any(axis=0))
    return np.asarray(rows[:, used] @ basis[used])


def reduce_terms(basis: Floats, terms: Terms, matrices: Projections | None = None) -> ReducedTerms:
    """Project what an effect adds onto a basis (n, r).

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
        port = (torch.from_numpy(line), torch.from_numpy(terms.port.rigid))
    stiffness = [
        ReducedStiffness(one.story, once(one.matrix), one.series) for one in terms.stiffness
    ]
    if terms.springs is not None:
        stretch = along(terms.springs.rows, basis)  # (c, r)
        own = stretch.T @ (terms.springs.stiffness[:, None] * stretch)
        stiffness.append(ReducedStiffness(UNSCALED, torch.from_numpy(0.5 * (own + own.T))))
    return ReducedTerms(
        stiffness=tuple(stiffness),
        hinges=None if terms.hinges is None else _reduced_hinges(basis, terms.hinges),
        mass=None if terms.mass is None else _reduced_mass(basis, terms.mass),
        flexibility=terms.flexibility,
        pitch=terms.pitch,
        port=port,
        constants=terms.constants,
    )


def _reduced_hinges(basis: Floats, hinges: Hinges) -> ReducedHinges:
    coupling = np.stack([along(own.T, basis).T for own in hinges.coupling])
    parts = coupling, np.stack(hinges.inner), hinges.spring
    return ReducedHinges(*(torch.from_numpy(part) for part in parts))


def _reduced_mass(basis: Floats, mass: AddedMass) -> ReducedMass:
    parts = (
        projected(basis, mass.matrix),
        along(mass.force.T, basis).T,
        mass.rigid,
        along(mass.above, basis),
        mass.above_rigid,
    )
    return ReducedMass(*(torch.from_numpy(np.asarray(part)) for part in parts))
