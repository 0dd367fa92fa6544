"""Reduced models: a building seen through a few shapes, affine in theta, and what effects add."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any
from weakref import ref

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.effects.effect import (
    UNSCALED,
    Array,
    Hinges,
    MassTerms,
    Placed,
    Port,
    Stiffness,
    Terms,
)
from femupdate.effects.structure import ACROSS, ROTATION, TRANSLATION, Structure
from femupdate.errors import brief
from femupdate.fe.model import DOF_PER_NODE
from femupdate.storage import check_shapes

# Arrays of a reduced model, with a letter an axis.
_ARRAYS = {
    "stiffness_terms": "prr",
    "stiffness_constant": "rr",
    "excitation": "r",
    "floor_shapes": "fr",
    "story_inertia": "sr",
    "story_mass": "s",
    "story_drift": "sr",
}
_ROTATION = ("force", "mass", "story_moment", "levels", "story_height")
_RELEASED = ("flexibility", "mass")


@dataclass(frozen=True, eq=False, kw_only=True)
class BaseRotation:
    """What a base that turns does to a reduced model."""

    force: Floats  # (r,) force on each coordinate per unit angular acceleration of the base
    mass: Floats  # (2, 2) mass, first and second moment of it about the base
    story_moment: Floats  # (s,) first moment of the mass above the middle of each story
    levels: Floats  # (f,) heights above the base of what the floor rows observe, m
    story_height: Floats  # (s,) m


@dataclass(frozen=True, eq=False, kw_only=True)
class ReleasedBase:
    """A base that forces move."""

    # (2,) of springs that hardly hold it, m/N and 1/(N m); zero where it is held
    flexibility: Floats
    mass: Floats  # (2, 2) of what moves with it beside the building, kg


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """Galerkin projection of a building on a mass-orthonormal basis V (mass matrix = identity).

    With K(theta) = stiffness_constant + sum_i theta_i stiffness_terms[i], relative displacement
    u = V q, uniform base acceleration a_g in one direction with influence vector i:
        q'' + C q' + K(theta) q = -excitation a_g.
    """

    __repr__ = brief

    stiffness_terms: Floats  # (p, r, r) one symmetric matrix a parameter, 1/s2
    stiffness_constant: Floats  # (r, r) the part that no parameter scales, 1/s2
    # (r,) V^T M i, the base motion's force on each coordinate per unit acceleration
    excitation: Floats
    # (f, r) displacement of each observed floor (mean over its sensor points, in the direction of
    # the motion) per unit coordinate
    floor_shapes: Floats
    floors: tuple[str, ...]  # names of the observed floors, bottom to top ("2F" ... "RF").
    # (s, r) force of inertia of all that lies above story i, per unit acceleration of each
    # coordinate (row i = i_above^T M V), kg
    story_inertia: Floats
    story_mass: Floats  # (s,) mass above the middle of story i in the direction of motion, kg
    story_drift: Floats  # (s, r) displacement of the floor above less that of the floor below
    # (N, 3, r) displacement of every node, float32, or None where not kept
    node_shapes: NDArray[np.float32] | None = None
    # of the base; None where the model knows of its translation alone
    rotation: BaseRotation | None = None
    # (r,) force on each coordinate per unit acceleration of the base across; None where that moves
    # no floor along
    across: Floats | None = None
    released: ReleasedBase | None = None  # the base under forces; None where they do not move it
    # (j, r) stretch of dashpots to the ground, of one N s/m each; None where there are none
    dashpots: Floats | None = None

    @property
    def size(self) -> int:
        """Number of reduced coordinates r."""
        return self.stiffness_constant.shape[0]

    @property
    def parameters(self) -> int:
        """Number of stiffness parameters p."""
        return self.stiffness_terms.shape[0]

    @cached_property
    def driving(self) -> tuple[tuple[float, Floats], ...]:
        """Forces (r,) of the motions whose responses shapes must give, each with its weight.

        See `Structure.driving`.
        """
        if self.across is None:
            return ((1.0, self.excitation),)
        forces = np.column_stack([self.excitation, self.across])
        at_rest = np.linalg.solve(self.stiffness(np.ones(self.parameters)), forces)
        along, beside = np.abs(self.floor_shapes @ at_rest).max(axis=0)
        return (1.0, self.excitation), (min(beside / along, 1.0), self.excitation + self.across)

    @cached_property
    def tensors(self) -> tuple[Tensor, ...]:
        """Stiffness terms (p, r r) and constant (r, r), forces (r, 3), mass at the base (3, 3).

        Then of the floors the shapes (f, r) and the rigid motion (f, 3) with the base.
        """
        turned, at_base = np.zeros_like(self.excitation), np.zeros((3, 3))
        levels = np.zeros(len(self.floors))
        if self.rotation is not None:  # a base without one has no mass here
            turned, levels = self.rotation.force, self.rotation.levels
            at_base[:2, :2] = self.rotation.mass
        terms = self.stiffness_terms.reshape(self.parameters, self.size**2)
        across = np.zeros_like(turned) if self.across is None else self.across
        forces = np.column_stack([self.excitation, turned, across])
        rigid = np.column_stack([np.ones_like(levels), levels, np.zeros_like(levels)])
        parts = terms, self.stiffness_constant, forces, at_base, self.floor_shapes, rigid
        return tuple(torch.from_numpy(part) for part in parts)

    def stiffness(self, theta: Floats) -> Floats:
        """Reduced stiffness matrices, (..., p) -> (..., r, r), 1/s2."""
        return self.stiffness_constant + np.einsum("...p,pij->...ij", theta, self.stiffness_terms)

    def first(self, count: int) -> "ReducedModel":
        """The model on the first shapes of its basis."""
        return self.on(np.eye(self.size, count))

    def on(self, shapes: Floats) -> "ReducedModel":
        """The model on orthonormal combinations (r, c) of its coordinates, without its nodes."""
        rotation = self.rotation
        return replace(
            self,
            stiffness_terms=shapes.T @ self.stiffness_terms @ shapes,
            stiffness_constant=shapes.T @ self.stiffness_constant @ shapes,
            excitation=self.excitation @ shapes,
            floor_shapes=self.floor_shapes @ shapes,
            story_inertia=self.story_inertia @ shapes,
            story_drift=self.story_drift @ shapes,
            node_shapes=None,
            rotation=None if rotation is None else replace(rotation, force=rotation.force @ shapes),
            across=None if self.across is None else self.across @ shapes,
            dashpots=None if self.dashpots is None else self.dashpots @ shapes,
        )

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All of it but the names of its floors, for a file."""
        every = {
            name: getattr(self, name) for name in (*_ARRAYS, "node_shapes", "dashpots", "across")
        }
        arrays = {name: array for name, array in every.items() if array is not None}
        if self.rotation is not None:
            arrays |= {f"rotation_{name}": getattr(self.rotation, name) for name in _ROTATION}
        if self.released is not None:
            arrays |= {f"released_{name}": getattr(self.released, name) for name in _RELEASED}
        return arrays

    @classmethod
    def of_arrays(cls, data: Mapping[str, NDArray[Any]], floors: Sequence[str]) -> "ReducedModel":
        """What `arrays` gave.

        Raises:
            ArchiveError: an array is missing, or of another shape.
        """
        check_shapes(data, _ARRAYS)
        turned, released = (
            {key.removeprefix(start): data[key] for key in data if key.startswith(start)}
            for start in ("rotation_", "released_")
        )
        return cls(
            **{name: data[name] for name in _ARRAYS},
            floors=tuple(floors),
            node_shapes=data.get("node_shapes"),
            dashpots=data.get("dashpots"),
            across=data.get("across"),
            # Files of before have no heights of stories; each stood on the one below.
            rotation=BaseRotation(
                **{"story_height": np.diff(turned["levels"], prepend=0.0)} | turned
            )
            if turned
            else None,
            released=ReleasedBase(**released) if released else None,
        )


# Of matrices by their identity, which another may take once the first is no more.
Projections = dict[int, tuple[ref[csc_matrix], Tensor]]


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """A structure seen through a mass-orthonormal basis of r shapes."""

    structure: Structure  # the full model
    model: ReducedModel  # its reduced model
    basis: Floats  # (n, r) the shapes
    # what effects add, by label, once it was asked for
    known: dict[str, Terms] = field(default_factory=dict, repr=False)
    # what `projected` makes of those that several effects share, by their identity
    matrices: Projections = field(default_factory=dict, repr=False)
    # the structure on more shapes whose first these are, or None
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
    mass, port, hinges, kept = terms.mass, terms.port, terms.hinges, slice(count)
    return replace(
        terms,
        stiffness=tuple(
            stiffness._replace(matrix=stiffness.matrix[kept, kept]) for stiffness in terms.stiffness
        ),
        hinges=None if hinges is None else replace(hinges, coupling=hinges.coupling[:, kept]),
        mass=None
        if mass is None
        else replace(
            mass,
            matrix=mass.matrix[kept, kept],
            force=mass.force[kept],
            above=mass.above[:, kept],
        ),
        port=None if port is None else replace(port, row=port.row[kept]),
    )


def projected(basis: Floats, matrix: csc_matrix) -> Floats:
    """basis^T matrix basis (r, r), through the rows in which the matrix has numbers."""
    by_row = matrix.tocsr(copy=True)
    by_row.eliminate_zeros()
    rows = np.flatnonzero(np.diff(by_row.indptr))
    part = basis[rows]
    result = part.T @ (by_row[rows][:, rows] @ part)
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
        known = done.get(id(matrix))
        if known is None or known[0]() is not matrix:
            known = ref(matrix), torch.from_numpy(projected(basis, matrix))
            done[id(matrix)] = known
        return known[1]

    port = None
    if terms.port is not None:
        line = along(terms.port.row[None], basis)[0]
        port = Port(torch.from_numpy(line), torch.as_tensor(terms.port.rigid))
    stiffness = [Stiffness(term.story, once(term.matrix), term.series) for term in terms.stiffness]
    if terms.springs is not None:
        stretch = along(terms.springs.rows, basis)  # (c, r)
        springs = stretch.T @ (terms.springs.stiffness[:, None] * stretch)
        stiffness.append(Stiffness(UNSCALED, torch.from_numpy(0.5 * (springs + springs.T))))
    hinges = None
    if terms.hinges is not None:
        coupling = np.stack([along(columns.T, basis).T for columns in terms.hinges.coupling])
        parts = coupling, terms.hinges.inner, terms.hinges.spring
        hinges = Hinges(*(torch.as_tensor(part) for part in parts))
    mass = None
    if (whole := terms.mass) is not None:
        sides = along(whole.force.T, basis).T, whole.rigid, along(whole.above, basis)
        numbers = projected(basis, whole.matrix), *sides, whole.above_rigid
        mass = MassTerms(*(torch.from_numpy(np.asarray(part)) for part in numbers))
    return Terms(
        stiffness=tuple(stiffness),
        hinges=hinges,
        mass=mass,
        flexibility=terms.flexibility,
        pitch=terms.pitch,
        port=port,
        constants=terms.constants,
    )


def released_base(structure: Structure) -> ReleasedBase | None:
    """How forces move the base of a structure; None where its building says that it is held."""
    supports = structure.building.supports
    if supports is None or not structure.building.moving_base:
        return None
    mass = np.zeros((2, 2))
    mass[TRANSLATION, TRANSLATION] = supports.mass or 0.0
    inertia = (structure.rigid_mass[:2, :2] + mass).diagonal()
    # The springs hold it at a thousandth of the building's first frequency.
    flexibility = 1.0 / (inertia * (1e-3 * structure.fundamental[0]) ** 2)
    if supports.base == "slides":
        flexibility[ROTATION] = 0.0
    return ReleasedBase(flexibility=flexibility, mass=mass)


def lumped(structure: Structure) -> ReducedStructure:
    """A stick as it is, in coordinates of unit mass."""
    return reduced_on(structure, np.diag(structure.mass.diagonal() ** -0.5), crosses=False)


def reduced_on(
    structure: Structure, basis: Floats, crosses: bool | None = None
) -> ReducedStructure:
    """A structure seen through a mass-orthonormal basis (n, r).

    Args:
        crosses: whether floors follow the base's motion across; None to find out.
    """
    if crosses is None:
        crosses = structure.crossing > 0.0
    force = basis.T @ structure.rigid_force
    rigid, nodes = structure.story_rigid, None
    if structure.operators is not None:
        nodes = np.empty((structure.operators.dof // DOF_PER_NODE, 3, basis.shape[1]), np.float32)
        for start in range(0, basis.shape[1], 32):  # all at once may fill gigabytes
            some = structure.operators.expand(basis[:, start : start + 32])
            nodes[:, :, start : start + 32] = some.reshape(len(nodes), DOF_PER_NODE, -1)[:, :3]
    model = ReducedModel(
        stiffness_terms=np.stack([projected(basis, term) for term in structure.stiffness_terms]),
        stiffness_constant=projected(basis, structure.stiffness_constant),
        excitation=force[:, TRANSLATION],
        floor_shapes=structure.floor_rows @ basis,
        floors=structure.floors,
        story_inertia=structure.story_inertia @ basis,
        story_mass=rigid[:, TRANSLATION],
        story_drift=structure.drift_rows @ basis,
        node_shapes=nodes,
        rotation=BaseRotation(
            force=force[:, ROTATION],
            mass=structure.rigid_mass[:2, :2],
            story_moment=rigid[:, ROTATION],
            levels=structure.levels,
            story_height=structure.building.over_foot(structure.levels),
        ),
        released=released_base(structure),
        across=force[:, ACROSS] if crosses else None,
        dashpots=dashpots_on(structure, basis),
    )
    return ReducedStructure(structure, model, basis)


def dashpots_on(structure: Structure, basis: Floats) -> Floats | None:
    """The dashpots of a structure on a basis (n, r), as few (j, r) as dissipate the same."""
    if not len(structure.dashpots):
        return None
    _, size, rows = np.linalg.svd(along(structure.dashpots, basis), full_matrices=False)
    kept = size > 1e-9 * size[0]  # the square of which is rounding
    return np.asarray(size[kept, None] * rows[kept])
