"""A small basis for the neighbourhood of one theta, where effects are tried one at a time.

A basis that serves stiffness factors over a range of nine, members apart, with torsion, needs many
hundred shapes, too many to be evaluated thousands of times. Near the most probable theta far fewer
do, when the responses they are taken from are those of the finder's own questions: the structure
itself, its neighbours, and each effect alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Singles
from femupdate.dynamics.equations import Equations, WithSprings, equations_at
from femupdate.dynamics.projection import lumped, reduced_on
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.dynamics.snapshots import STATIC_WEIGHT, FeltModes, ReductionTarget, compressed
from femupdate.dynamics.thresholds import LOCAL_BASIS
from femupdate.effects.effect import Placed, Terms
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.fe.assembly import AffineOperators, with_terms
from femupdate.fe.factorization import factorize
from femupdate.fe.solve import modes_below
from femupdate.progress import SILENT, Progress
from femupdate.seeds import even_points
from femupdate.workers import everywhere

_NOTHING = 1e-10  # of the largest energy among shapes: it adds nothing new

Sized = tuple[tuple[Placed, float], ...]
"""Effects, each with its first parameter."""


@dataclass(frozen=True, eq=False)
class _Question:
    """What is solved: terms of some sizes at stiffness factors theta (p,)."""

    added: tuple[tuple[Terms, float], ...]
    theta: Floats


def local_structure(
    structure: Structure,
    theta: Floats,
    target: ReductionTarget,
    progress: Progress = SILENT,
    *,
    spread: float = LOCAL_BASIS.spread,
    size: int = LOCAL_BASIS.size,
    present: Sequence[Sized] | None = None,
) -> ReducedStructure:
    """A frame on a basis for the neighbourhood of theta, from its full model.

    One full eigenproblem, and for some questions one step each from there: some thirty where every
    effect of the catalogue may act, each alone; ten where only those that are present do, all
    together. A stick is its own reduction and comes back as it is.

    Args:
        theta: (p,) story factors.
        progress: advances by one a question.
        spread: half width of the neighbourhood in ln theta.
        present: effects that the model has, and the first parameter of each, where no others need
            act; several such sets where it may have one or another; None for the catalogue.
    """
    if structure.operators is None:
        return lumped(structure)
    sets = _of_catalogue(structure) if present is None else _about(structure, present)
    questions = [_Question(one, theta) for one in sets]
    questions += [_Question(sets[0], near) for near in _neighbours(theta, spread)]
    middle = equations_at(structure, theta, sets[0])
    known = modes_below(_alone(structure.operators, middle), np.zeros(0), target.top_hz)
    shapes: list[Floats | Singles] = []
    if present is not None:
        shapes += _along_ports(structure, middle, present)
    progress.start("Reducing the model for effects", len(questions))
    modes = known.shapes, _times(structure.mass, known.shapes)
    task = partial(_answer, structure, modes, target)
    for one in everywhere(task, questions):
        shapes.append(one)
        progress.advance()
    basis = compressed(structure.mass, shapes, size)
    return reduced_on(structure, basis)


def _along_ports(structure: Structure, equations: Equations, sets: Sequence[Sized]) -> list[Floats]:
    """What a force in the line of each effect that is present moves, (n, 1) each.

    Modes alone do not hold what gives at a point; the force is that of the whole mass at 1 m/s2.
    """
    acting = {placed.label: placed for present in sets for placed, _ in present}
    terms = (one.effect.terms(structure, one.place) for one in acting.values())
    rows = [own.port.row for own in terms if own.port is not None]
    if not rows:
        return []
    factors = WithSprings(factorize(equations.stiffness), equations.springs)
    force = structure.rigid_mass[TRANSLATION, TRANSLATION]
    return [STATIC_WEIGHT * factors.apply(force * row[:, None]) for row in rows]


def _alone(operators: AffineOperators, equations: Equations) -> AffineOperators:
    """The operators of changed equations, without stiffness factors."""
    changed = replace(operators, stiffness_constant=equations.stiffness, mass=equations.mass)
    return with_terms(changed, ())


def _of_catalogue(structure: Structure) -> list[tuple[tuple[Terms, float], ...]]:
    """No effect, and every effect of stiffness or mass where a basis must know it."""
    found: list[tuple[tuple[Terms, float], ...]] = [()]
    for effect in CATALOGUE.values():
        for place, size in effect.basis_questions(structure):
            terms = effect.terms(structure, place)
            if terms.changes_shapes:
                found.append(((terms, size),))
    return found


def _about(structure: Structure, sets: Sequence[Sized]) -> list[tuple[tuple[Terms, float], ...]]:
    """All effects of each set as they are, and with the size of one after the other changed."""
    return [one for present in sets for one in _changes(structure, present)]


def _changes(structure: Structure, present: Sized) -> list[tuple[tuple[Terms, float], ...]]:
    terms = [placed.effect.terms(structure, placed.place) for placed, _ in present]
    sizes = [size for _, size in present]
    asked = [tuple(zip(terms, sizes, strict=True))]
    for number, (placed, size) in enumerate(present):
        if not placed.effect.parameters or not terms[number].changes_shapes:
            continue
        own = placed.effect.parameters[0]
        step = max(LOCAL_BASIS.changed * abs(size), 0.5 * own.scale)
        for other in (size - step, size + step):
            if own.lower <= other <= own.upper:
                moved = [*sizes[:number], other, *sizes[number + 1 :]]
                asked.append(tuple(zip(terms, moved, strict=True)))
    return asked


def _neighbours(theta: Floats, spread: float) -> Floats:
    """Some theta (n, p) around one, evenly within the half width in ln theta."""
    unit = even_points(LOCAL_BASIS.neighbours, len(theta), 3)
    return np.asarray(theta * np.exp(spread * (2.0 * unit - 1.0)))


def _answer(
    structure: Structure, known: Sequence[Floats], target: ReductionTarget, question: _Question
) -> Singles:
    """See `nearby_shapes`; known are modes (n, m), and their forces of inertia without effects."""
    equations = equations_at(structure, question.theta, question.added)
    modes, image = known
    heavier = any(terms.mass is not None for terms, _ in question.added)
    own = None if heavier else image
    shapes = nearby_shapes(equations, structure.floor_rows, modes, target, own)
    return shapes.astype(np.float32)


def nearby_shapes(
    equations: Equations,
    rows: Floats,
    known: Floats,
    target: ReductionTarget,
    image: Floats | None = None,
) -> Floats:
    """Weighted shapes (n, c) that span the responses of a changed model over the grid.

    The response among the known modes, and one step of inverse iteration from it (Bathe 2014,
    section 11.6): u = K^-1 (f + w^2 M u) with the K and M of the changed model. It takes one
    factorisation and a third as many solutions as there are modes, for of the modes of a building
    with slabs the floors feel a few.

    Args:
        equations: of the changed model.
        rows: (f, n) where its floors are observed.
        known: (n, m) modes of the model that it differs little from.
        image: (n, m) the mass of the changed model times these, where it is at hand.
    """
    factors = WithSprings(factorize(equations.stiffness), equations.springs)
    force, count = equations.force[:, TRANSLATION], known.shape[1]
    static = factors.apply(force[:, None])[:, 0]
    image = _times(equations.mass, known) if image is None else image
    own = _Projected(known.T @ factors.times(known), known.T @ image, rows @ known, force @ known)
    first = own.responses(rows @ static, target)
    # What the stiffness makes of the new shapes are the right-hand sides that they solve.
    right = image @ first
    fresh = np.column_stack([factors.apply(right), static])
    moved = _times(equations.mass, fresh)
    driven = force @ fresh
    across = np.column_stack([known.T @ right, own.driven])
    within = np.column_stack([fresh.T @ right, driven])
    both = _Projected(
        _symmetric(own.stiffness, across, within),
        _symmetric(own.mass, image.T @ fresh, fresh.T @ moved),
        np.column_stack([own.floors, rows @ fresh]),
        np.append(own.driven, driven),
    )
    combined = both.responses(rows @ static, target)
    shapes = known @ combined[:count] + fresh @ combined[count:]
    return np.column_stack([shapes, STATIC_WEIGHT * static])


@dataclass(frozen=True, eq=False)
class _Projected:
    """A model on a basis of b shapes.

    Attributes:
        stiffness, mass: (b, b).
        floors: (f, b) what the floors show of the shapes.
        driven: (b,) what drives them.
    """

    stiffness: Floats
    mass: Floats
    floors: Floats
    driven: Floats

    def responses(self, static: Floats, target: ReductionTarget) -> Floats:
        """Combinations (b, c) of the basis that span the responses of the model on it.

        Args:
            static: (f,) displacement of the floors under the force that drives the model.
        """
        scale = np.sqrt(self.mass.diagonal())
        # Not NumPy's: the method of divide and conquer has failed on such matrices.
        energy, directions = eigh(self.mass / np.outer(scale, scale))
        kept = energy > _NOTHING * energy[-1]
        onto = (directions[:, kept] / np.sqrt(energy[kept])) / scale[:, None]
        squared, vectors = eigh(onto.T @ self.stiffness @ onto)
        modes = onto @ vectors
        participation, floors = self.driven @ modes, self.floors @ modes
        missed = static - (floors * participation) @ (1.0 / squared)
        felt = FeltModes(np.sqrt(squared), participation, floors, missed)
        return modes @ felt.combinations(target, LOCAL_BASIS.least)


def _times(matrix: csc_matrix, shapes: Floats) -> Floats:
    """Symmetric matrix times shapes, by its rows: three times as fast as by its columns."""
    return np.asarray(matrix.T @ np.ascontiguousarray(shapes))


def _symmetric(first: Floats, between: Floats, second: Floats) -> Floats:
    """Symmetric matrix of its blocks."""
    whole = np.block([[first, between], [between.T, second]])
    return 0.5 * (whole + whole.T)
