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

from femupdate.arrays import Floats, Indices, Singles
from femupdate.dynamics.equations import Equations, WithSprings, equations_at
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure, lumped, reduced_on
from femupdate.dynamics.snapshots import STATIC_WEIGHT, FeltModes, ReductionTarget, compressed
from femupdate.effects.effect import Placed, Terms
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.fe.driven import Factored
from femupdate.fe.factorization import Factorization
from femupdate.fe.mechanism import factorize_held
from femupdate.fe.products import along, combined, diagonal, symmetric_times
from femupdate.fe.solve import NaturalModes, modes_below
from femupdate.progress import SILENT, Progress
from femupdate.seeds import even_points
from femupdate.workers import in_threads

SPREAD, SIZE = 0.2, 220  # half width in ln theta, and shapes of a basis

Sized = tuple[tuple[Placed, float], ...]
"""Effects, each with its first parameter."""
Question = tuple[tuple[tuple[Terms, float], ...], Floats]
"""Terms of some sizes, at stiffness factors theta (p,)."""
Change = tuple[Indices, Floats]
"""Rows (w,) that a change of a matrix touches, and the change times known shapes (w, m)."""


def local_structure(
    structure: Structure,
    theta: Floats,
    target: ReductionTarget,
    progress: Progress = SILENT,
    *,
    size: int = SIZE,
    present: Sequence[Sized] | None = None,
) -> ReducedStructure:
    """A frame on a basis for the neighbourhood of theta, from its full model.

    One full eigenproblem, and for some questions one step each from there: some thirty where every
    effect of the catalogue may act, each alone; ten where only those that are present do, all
    together. A stick is its own reduction and comes back as it is.

    Args:
        theta: (p,) story factors.
        present: effects that the model has, and the first parameter of each, where no others need
            act; several such sets where it may have one or another; None for the catalogue.
    """
    if structure.operators is None:
        return lumped(structure)
    sets = (
        _of_catalogue(structure)
        if present is None
        else [changed for listed in present for changed in _changes(structure, listed)]
    )
    questions: list[Question] = [(terms, theta) for terms in sets]
    # Eight samples of theta near the middle are solved beside it.
    unit = even_points(8, len(theta), 3)
    questions += [(sets[0], near) for near in theta * np.exp(SPREAD * (2.0 * unit - 1.0))]
    middle = equations_at(structure, theta, sets[0])
    parts = {"stiffness_terms": (), "stiffness_constant": middle.stiffness, "mass": middle.mass}
    alone = replace(structure.operators, **parts)
    factors = factorize_held(alone, middle.stiffness)
    modes = modes_below(alone, np.zeros(0), target.top_hz, factors)
    shapes: list[Floats | Singles] = []
    shapes += _along_ports(structure, WithSprings(factors, middle.springs), present or ())
    progress.start("Reducing the model for effects", len(questions))
    task = partial(_answer, structure, KnownModes.of(middle, modes, factors), target)
    shapes += in_threads(task, questions, progress)
    return reduced_on(structure, compressed(structure.mass, shapes, size))


def model_about(model: ReducedModel, thetas: Floats, target: ReductionTarget) -> ReducedModel:
    """A reduced model on shapes of its own responses about thetas (n, p), those first that count.

    A posterior fills little of the prior. About one of the six-story frame, 100 of 300 shapes err
    by .00015 rms of ln|H|.
    """
    shapes = []
    for theta in thetas:
        omega, modes = diagonal(model.stiffness(theta))
        dashpots = None if model.dashpots is None else model.dashpots @ modes
        for scale, force in model.driving:
            driven = scale * force @ modes
            felt = FeltModes(omega, driven, model.floor_shapes @ modes, dashpots)
            weights = [felt.combinations(target), STATIC_WEIGHT * (driven / omega**2)[:, None]]
            shapes.append(modes @ np.column_stack(weights))
    return model.on(np.linalg.svd(np.column_stack(shapes), full_matrices=False)[0])


def _along_ports(structure: Structure, factors: Factored, sets: Sequence[Sized]) -> list[Floats]:
    """What a force along each effect that is present, or along a dashpot, moves, (n, 1) each."""
    acting = {placed.label: placed for present in sets for placed, _ in present}
    terms = (listed.effect.terms(structure, listed.place) for listed in acting.values())
    rows = [term.port.row for term in terms if term.port is not None]
    force = structure.rigid_mass[TRANSLATION, TRANSLATION]
    columns = [*(force * row for row in rows), *structure.dashpot_forces]
    return [STATIC_WEIGHT * factors.apply(column[:, None]) for column in columns]


def _of_catalogue(structure: Structure) -> list[tuple[tuple[Terms, float], ...]]:
    """No effect, and every effect of stiffness or mass where a basis must know it."""
    found: list[tuple[tuple[Terms, float], ...]] = [()]
    for effect in CATALOGUE.values():
        for place, size in effect.basis_questions(structure):
            terms = effect.terms(structure, place)
            if terms.changes_shapes:
                found.append(((terms, size),))
    return found


def _changes(structure: Structure, present: Sized) -> list[tuple[tuple[Terms, float], ...]]:
    """All effects as they are, and with the size of one after the other changed."""
    terms = [placed.effect.terms(structure, placed.place) for placed, _ in present]
    sizes = [size for _, size in present]
    asked = [tuple(zip(terms, sizes, strict=True))]
    for number, (placed, size) in enumerate(present):
        if not placed.effect.parameters or not terms[number].changes_shapes:
            continue
        first = placed.effect.parameters[0]
        # An effect that is present is changed by a fifth of its size.
        step = max(0.2 * abs(size), 0.5 * first.scale)
        for other in (size - step, size + step):
            if first.lower <= other <= first.upper:
                moved = [*sizes[:number], other, *sizes[number + 1 :]]
                asked.append(tuple(zip(terms, moved, strict=True)))
    return asked


@dataclass(frozen=True, eq=False)
class KnownModes:
    """Modes of equations without their springs, from which changed ones are answered.

    An eigensolver's modes are orthonormal to its tolerance alone. What they are is projected, not
    what they should be: the difference, of 1e-9, would pass for new directions beside them.
    """

    equations: Equations  # without the changes
    shapes: Floats  # (n, m) of unit modal mass
    stiffness: Floats  # (m, m) of the equations on the shapes
    mass: Floats
    factors: Factorization  # of the equations' stiffness

    @staticmethod
    def of(equations: Equations, modes: NaturalModes, factors: Factorization) -> "KnownModes":
        """From the modes of the equations."""
        shapes = np.ascontiguousarray(modes.shapes)
        stiffness, mass = (
            along(shapes, symmetric_times(matrix, shapes))
            for matrix in (equations.stiffness, equations.mass)
        )
        return KnownModes(equations, shapes, stiffness, mass, factors)

    def of_changed(self, changed: Equations) -> tuple[Floats, Floats, Change, Change]:
        """Stiffness and mass (m, m) of changed equations on the shapes, and what changes in both.

        The springs count in the small stiffness alone.
        """
        spring = changed.springs.rows @ self.shapes
        pulled = spring.T @ (changed.springs.stiffness[:, None] * spring)
        stiffer = self._times(changed.stiffness - self.equations.stiffness)
        heavier = self._times(changed.mass - self.equations.mass)
        stiffness, mass = (
            small + self.shapes[rows].T @ more
            for small, (rows, more) in ((self.stiffness + pulled, stiffer), (self.mass, heavier))
        )
        return stiffness, mass, stiffer, heavier

    def _times(self, change: csc_matrix) -> Change:
        """The rows (w,) that a symmetric change (n, n) touches, and it times the shapes (w, m)."""
        rows = np.flatnonzero(np.diff(change.indptr)).astype(np.int32)
        return rows, np.asarray(change.T[rows] @ self.shapes)


def _answer(
    structure: Structure, known: KnownModes, target: ReductionTarget, question: Question
) -> Singles:
    """See `nearby_shapes`."""
    equations, lines = equations_at(structure, question[1], question[0]), structure.dashpots
    found = [
        scale * nearby_shapes(equations, motion, structure.floor_rows, known, target, lines)
        for scale, motion in structure.driving
    ]
    return np.column_stack(found).astype(np.float32)


def nearby_shapes(
    equations: Equations,
    motion: Floats,
    rows: Floats,
    known: KnownModes,
    target: ReductionTarget,
    dashpots: Floats | None = None,
) -> Floats:
    """Weighted shapes (n, c) that span the responses of a changed model over the grid.

    The response among the known modes, what springs pull, and what the known stiffness makes of
    the residual (K - w^2 M) u - f (Davidson 1975, J. Comput. Phys. 17, 87). It takes a third as
    many solutions as there are modes, for of the modes of a building with slabs the floors feel a
    few. With steps by the changed stiffness, factorised each time, 220 shapes of the six-story
    frame err by .0042 rms of ln|H| over all effects and factors, by .0038 with these.

    Args:
        equations: of the changed model.
        motion: (3,) of the base, in the columns of `Structure.rigid_force`.
        rows: (f, n) where its floors are observed.
        known: of the model that it differs little from.
        dashpots: (j, n) as those of a `Structure`.
    """
    lines = dashpots if dashpots is not None and len(dashpots) else None
    # What is solved is without the changes, what is multiplied with them.
    solved = replace(known.factors, matrix=equations.stiffness)
    factors = WithSprings(solved, equations.springs)
    force, modes = equations.force @ motion, known.shapes
    started = factors.apply(force[:, None])
    static = (2.0 * started - factors.apply(factors.times(started)))[:, 0]
    stiffness, mass, stiffer, heavier = known.of_changed(equations)
    seen = None if lines is None else lines @ modes
    coarse = _Projected(stiffness, mass, rows @ modes, force @ modes, seen)
    first, forces = coarse.responses(rows @ static, target)
    # What no change has made of the residual pushes the modes alone, which are in the basis.
    residual = np.zeros((len(modes), first.shape[1]))
    residual[stiffer[0]] += stiffer[1] @ first
    residual[heavier[0]] -= heavier[1] @ forces
    corrections = [solved.apply(residual)] if residual.any() else []
    fresh = np.column_stack([*corrections, factors.moved, started, static])
    # Projected as they are, and not as solutions: what the solver leaves would pass for stiffness.
    held, moved = factors.times(fresh), symmetric_times(equations.mass, fresh)
    both = _Projected(
        _symmetric(coarse.stiffness, along(modes, held), fresh.T @ held),
        _symmetric(coarse.mass, along(modes, moved), fresh.T @ moved),
        np.column_stack([coarse.floors, rows @ fresh]),
        np.append(coarse.driven, force @ fresh),
        None if seen is None or lines is None else np.column_stack([seen, lines @ fresh]),
    )
    weights = both.responses(rows @ static, target)[0]
    count = modes.shape[1]
    shapes = combined(modes, weights[:count]) + combined(fresh, weights[count:])
    return np.column_stack([shapes, STATIC_WEIGHT * static])


@dataclass(frozen=True, eq=False)
class _Projected:
    """A model on a basis of b shapes."""

    stiffness: Floats  # (b, b)
    mass: Floats
    floors: Floats  # (f, b) what the floors show of the shapes
    driven: Floats  # (b,) what drives them
    dashpots: Floats | None  # (j, b) their stretch

    def responses(self, static: Floats, target: ReductionTarget) -> tuple[Floats, Floats]:
        """Combinations (b, c) of the basis that span the responses of the model on it.

        Beside them the same of its modes times their squared frequencies.

        Args:
            static: (f,) displacement of the floors under the force that drives the model.
        """
        scale = np.sqrt(self.mass.diagonal())
        # Not NumPy's: the method of divide and conquer has failed on such matrices.
        energy, directions = eigh(self.mass / np.outer(scale, scale))
        # A direction of less energy, of the largest, adds nothing new. Rounding leaves
        # 1e-14 to energies and, at 1e-11, a millionth of the first squared frequency to stiffnesses
        # (two frames of 31,000 degrees of freedom). At 1e-8 a frame without walls errs by .04 rms
        # of ln|H|, not .0003.
        kept = energy > 1e-11 * energy[-1]
        onto = (directions[:, kept] / np.sqrt(energy[kept])) / scale[:, None]
        squared, vectors = eigh(onto.T @ self.stiffness @ onto)
        stands = squared > 0.0  # what a negative stiffness pushes away has no steady response
        squared, modes = squared[stands], onto @ vectors[:, stands]
        participation, floors = self.driven @ modes, self.floors @ modes
        missed = static - (floors * participation) @ (1.0 / squared)
        stretch = None if self.dashpots is None else self.dashpots @ modes
        felt = FeltModes(np.sqrt(squared), participation, floors, stretch, missed[:, None])
        # Shapes of less energy, of the largest, are left out: a two-story frame with a brace as
        # stiff as itself errs by .0047 rms of ln|H|, by .0050 with 1e-6.
        found = felt.combinations(target, 1e-7)
        return modes @ found, (modes * squared) @ found


def _symmetric(first: Floats, between: Floats, second: Floats) -> Floats:
    """Symmetric matrix of its blocks."""
    whole = np.block([[first, between], [between.T, second]])
    return 0.5 * (whole + whole.T)
