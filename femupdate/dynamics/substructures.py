"""A structure as parts that one stiffness factor each scales, joined along few coordinates.

What one term of the stiffness alone touches lies inside of its part. There the factor scales the
whole stiffness: its factorisation, the shapes in which the joints move it and its modes with the
joints held are the same for all factors (Craig and Bampton 1968, AIAA Journal 6). A building of
stories has a twentieth of its degrees of freedom on joints and such modes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Integers
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.errors import StructureError
from femupdate.fe.assembly import AffineOperators, with_terms
from femupdate.fe.driven import orthonormal
from femupdate.fe.factorization import Factorization
from femupdate.fe.mechanism import factorize_held
from femupdate.fe.products import symmetric_times
from femupdate.fe.solve import modes_below


@dataclass(frozen=True, eq=False)
class Substructure:
    """What one term of the stiffness scales: m degrees of freedom inside, b joints, k modes."""

    inner: Integers  # (m,) degrees of freedom
    border: Integers  # (b,) numbers of its joints
    alone: AffineOperators  # the inside, its joints held
    coupling: csc_matrix  # (m, b) mass between inside and joints
    moved: Floats  # (m, b) displacement inside under unit displacements of the joints
    held: Floats  # (b, b) stiffness that the joints feel
    joint_mass: Floats  # (b, b) of what the joints move inside
    shapes: Floats  # (m, k) orthonormal in mass and diagonal in stiffness, the joints held
    squared: Floats  # (k,) their squared circular frequencies

    @cached_property
    def factors(self) -> Factorization:
        """Of the stiffness inside; never sent to other processes."""
        return factorize_held(self.alone, self.alone.stiffness_constant)

    @cached_property
    def modal_mass(self) -> Floats:
        """(b, k) mass between joints and modes."""
        images = symmetric_times(self.alone.mass, self.shapes)
        return np.asarray(self.moved.T @ images + self.coupling.T @ self.shapes)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "factors"}

    def with_forces(self, forces: Floats) -> tuple["Substructure", Floats]:
        """With the shapes in which forces (m, c) move the inside; old ones (k, k + c) among all."""
        mass = self.alone.mass
        shapes, _ = orthonormal(self.factors.apply(forces), self.shapes, mass)
        both = np.column_stack([self.shapes, shapes])
        squared, directions = np.linalg.eigh(both.T @ self.factors.times(both))
        old = directions[: len(self.squared)]
        return replace(self, shapes=both @ directions, squared=squared), old


@dataclass(frozen=True, eq=False)
class Substructures:
    """A structure on j joints and on the modes of its parts: q coordinates."""

    structure: Structure
    parts: tuple[Substructure, ...]  # one a term, the last of what no factor scales
    joints: Integers  # (j,) degrees of freedom, in the order of the parts
    joint_mass: csc_matrix  # (j, j) mass of the joints themselves

    @property
    def T(self) -> "Substructures":  # noqa: N802
        """Itself: it is multiplied as the symmetric mass matrix (q, q) is."""
        return self

    def __matmul__(self, shapes: Floats) -> Floats:
        """Mass times shapes (q, c)."""
        found, joints = np.empty_like(shapes), slice(len(self.joints))
        found[joints] = symmetric_times(self.joint_mass, shapes[joints])
        for part, modal in self.each():
            moved, modes = shapes[part.border], shapes[modal]
            found[part.border] += part.joint_mass @ moved + part.modal_mass @ modes
            found[modal] = part.modal_mass.T @ moved + modes
        return found

    def each(self) -> Iterator[tuple[Substructure, slice]]:
        """Every part, and where its modes stand among the coordinates."""
        start = len(self.joints)
        for part in self.parts:
            yield part, slice(start, start + len(part.squared))
            start += len(part.squared)

    def condensed(self, loads: Floats) -> Floats:
        """What loads (n, c) do along the coordinates, (q, c)."""
        size = len(self.joints) + sum(len(part.squared) for part in self.parts)
        found = np.empty((size, loads.shape[1]))
        found[: len(self.joints)] = loads[self.joints]
        for part, modal in self.each():
            inside = loads[part.inner]
            found[part.border] += part.moved.T @ inside
            found[modal] = part.shapes.T @ inside
        return found

    def expanded(self, shapes: Floats) -> Floats:
        """Displacements (n, c) of shapes (q, c)."""
        found = np.empty((len(self.structure.axis), shapes.shape[1]))
        found[self.joints] = shapes[: len(self.joints)]
        for part, modal in self.each():
            found[part.inner] = part.moved @ shapes[part.border] + part.shapes @ shapes[modal]
        return found

    def with_inertia(self, shapes: Floats) -> tuple["Substructures", Floats]:
        """With what the inertia of shapes (q, c), and that of the base, moves inside of each part.

        Returns:
            the parts, and the shapes in their coordinates. K^-1 M of the whole structure leads from
            the shapes to no other displacements than these have, at all factors.
        """
        base = self.structure.rigid_force[:, [TRANSLATION]]
        forces = np.column_stack([self.structure.mass @ self.expanded(shapes), base])
        parts, coordinates = [], [shapes[: len(self.joints)]]
        for part, modal in self.each():
            inside = shapes[modal]
            if len(part.inner):
                part, old = part.with_forces(forces[part.inner])
                inside = old.T @ inside
            parts.append(part)
            coordinates.append(inside)
        return replace(self, parts=tuple(parts)), np.vstack(coordinates)

    @cached_property
    def _triangles(self) -> tuple[tuple[int, int], list[tuple[Integers, Floats]]]:
        """Shape of the lower band of the joints, and of each part where its stiffness stands."""
        width = max(int(np.ptp(part.border)) for part in self.parts if len(part.border))
        shape, triangles = (width + 1, len(self.joints)), []
        for part in self.parts:
            rows, columns = np.tril_indices(len(part.border))
            first, last = part.border[columns], part.border[rows]
            triangles.append(((last - first) * shape[1] + first, part.held[rows, columns]))
        return shape, triangles

    def at(self, theta: Floats) -> "Joined":
        """The stiffness at theta (p,), factorised.

        Raises:
            StructureError: the structure is a mechanism.
        """
        factors = np.append(theta, 1.0)
        shape, triangles = self._triangles
        band = np.zeros(shape)
        for factor, (places, held) in zip(factors, triangles, strict=True):
            band.ravel()[places] += factor * held
        try:
            return Joined(self, factors, cholesky_banded(band, lower=True, overwrite_ab=True))
        except np.linalg.LinAlgError:
            operators = self.structure.meshed[1]
            factorize_held(operators, operators.stiffness(theta))  # names what moves
            raise StructureError("the stiffness of the joints is not positive") from None


@dataclass(frozen=True, eq=False)
class Joined:
    """The stiffness (q, q) on the coordinates of substructures, factorised."""

    whole: Substructures
    factors: Floats  # (p + 1,) of the parts
    joints: Floats  # banded Cholesky factor of the stiffness that the joints feel

    def apply(self, rhs: Floats) -> Floats:
        """Solve for (q, c)."""
        found, joints = np.empty_like(rhs), slice(len(self.whole.joints))
        found[joints] = cho_solve_banded((self.joints, True), rhs[joints])
        for factor, (part, modal) in zip(self.factors, self.whole.each(), strict=True):
            found[modal] = rhs[modal] / (factor * part.squared[:, None])
        return found

    def times(self, shapes: Floats) -> Floats:
        """The stiffness times shapes (q, c)."""
        found = np.zeros_like(shapes)
        for factor, (part, modal) in zip(self.factors, self.whole.each(), strict=True):
            found[part.border] += factor * (part.held @ shapes[part.border])
            found[modal] = factor * part.squared[:, None] * shapes[modal]
        return found


def substructures(structure: Structure, top_hz: float) -> Substructures | None:
    """Parts of a frame with their modes up to a frequency; None where they would not pay.

    Raises:
        StructureError: the structure is a mechanism.
    """
    operators = structure.meshed[1]
    terms = [
        csc_matrix(term, copy=True)
        for term in (*structure.stiffness_terms, structure.stiffness_constant)
    ]
    for term in terms:
        term.eliminate_zeros()
    touched = np.stack([np.diff(term.indptr) > 0 for term in terms])
    owner = np.where(touched.sum(axis=0) == 1, touched.argmax(axis=0), -1)
    mass = structure.mass.tocoo()
    left, right = owner[mass.row], owner[mass.col]
    # Mass that lies across two parts makes joints of what it couples.
    owner[mass.row[(left != right) & (left >= 0) & (right >= 0) & (mass.data != 0.0)]] = -1
    joints = np.flatnonzero(owner < 0)
    # Up to this share of joints parts pay: .04 to .09 in buildings with a factor a story; .26 with
    # factors of members, where the joints alone cost as much as the whole.
    if not 0 < len(joints) <= 0.125 * len(owner):
        return None
    # In the order in which the parts begin and end, near ones have numbers near to each other.
    ends = touched[::-1, joints].argmax(axis=0), touched[:, joints].argmax(axis=0)
    joints = joints[np.lexsort((-ends[0], ends[1]))]
    parts = []
    for number, term in enumerate(terms):
        inner = np.flatnonzero(owner == number)
        rows, masses = term[inner], structure.mass[inner]
        coupled = np.diff(masses.indptr) > 0
        border = np.flatnonzero((touched[number] | coupled)[joints])
        at = joints[border]
        alone = replace(
            operators,
            free=operators.free[inner],
            stiffness_constant=rows[:, inner].tocsc(),
            mass=masses[:, inner].tocsc(),
        )
        coupling, held = masses[:, at].tocsc(), term[at][:, at].toarray()
        none = np.zeros((len(inner), 0)), np.zeros(0)
        moved = np.zeros((len(inner), len(at)))
        part = Substructure(inner, border, alone, coupling, moved, held, np.zeros_like(held), *none)
        if len(inner):  # what the joints move inside, and the modes with the joints held
            stiffness = rows[:, at].toarray()
            moved = -part.factors.apply(stiffness)
            modes = modes_below(with_terms(alone, ()), np.zeros(0), top_hz, part.factors)
            both = coupling.T @ moved
            part = replace(
                part,
                moved=moved,
                held=held + stiffness.T @ moved,
                joint_mass=moved.T @ symmetric_times(alone.mass, moved) + both + both.T,
                shapes=modes.shapes,
                squared=(2.0 * np.pi * modes.frequency_hz) ** 2,
            )
        parts.append(part)
    return Substructures(structure, tuple(parts), joints, structure.mass[joints][:, joints].tocsc())
