"""Reduced models that follow the full model's FRFs over a whole box of parameters, certified.

The parameters are stiffness factors and, where a building lists effects, their sizes. The basis is
taken from responses of the model at samples of them (`femupdate.dynamics.snapshots`) and is judged
by the full model at others.

Where every factor scales a part of the structure, responses are taken from the parts, which cost
less. What one term of the stiffness alone touches lies inside of its part. There the factor scales
the whole stiffness: its factorisation, the shapes in which the joints move it and its modes with
the joints held are the same for all factors (Craig and Bampton 1968, AIAA Journal 6). A building of
stories has a twentieth of its degrees of freedom on joints and such modes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import torch
from scipy.linalg import cholesky_banded, solve_triangular
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Integers, Singles
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.equations import DrivenSystem, driven_system
from femupdate.dynamics.excitation import Excitation
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure, lumped, reduced_on
from femupdate.dynamics.snapshots import (
    SAMPLES,
    STATIC_WEIGHT,
    FeltModes,
    ReductionTarget,
    compressed,
    log_even_samples,
)
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed, Terms
from femupdate.effects.structure import ACROSS, ROTATION, TRANSLATION, Structure
from femupdate.errors import StructureError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.driven import Factored, driven_shapes
from femupdate.fe.factorization import Factorization
from femupdate.fe.mechanism import factorize_held
from femupdate.fe.products import along, combined, diagonal, orthonormal, symmetric_times
from femupdate.fe.solve import modes_below
from femupdate.progress import SILENT, Progress
from femupdate.seeds import spawn
from femupdate.workers import in_threads


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
    factors: Factorization | None = None  # of the stiffness inside; none where nothing is

    @cached_property
    def modal_mass(self) -> Floats:
        """(b, k) mass between joints and modes."""
        images = symmetric_times(self.alone.mass, self.shapes)
        return np.asarray(self.moved.T @ images + self.coupling.T @ self.shapes)

    def solved(self, between: csc_matrix, top_hz: float) -> "Substructure":
        """With what the joints move inside, and the modes up to a frequency with the joints held.

        Args:
            between: (m, b) stiffness between inside and joints.
        """
        factors = factorize_held(self.alone, self.alone.stiffness_constant)
        moved = -factors.apply(between.toarray())
        both = self.coupling.T @ moved
        part = replace(
            self,
            factors=factors,
            moved=moved,
            held=self.held + between.T @ moved,
            joint_mass=moved.T @ symmetric_times(self.alone.mass, moved) + both + both.T,
        )
        if not top_hz:
            return part
        modes = modes_below(self.alone, np.zeros(0), top_hz, factors)
        squared = (2.0 * np.pi * modes.frequency_hz) ** 2
        return replace(part, shapes=modes.shapes, squared=squared)

    def with_forces(self, forces: Floats) -> tuple["Substructure", Floats]:
        """With the shapes in which forces (m, c) move the inside; old ones (k, k + c) among all."""
        assert self.factors is not None
        weigh = partial(symmetric_times, self.alone.mass)
        shapes, _ = orthonormal(self.factors.apply(forces), self.shapes, weigh)
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
        inertia = self.structure.mass @ self.expanded(shapes)
        forces = np.column_stack([inertia, self.structure.forces])
        return self.with_forces(forces, shapes)

    def with_forces(self, forces: Floats, shapes: Floats) -> tuple["Substructures", Floats]:
        """With what forces (n, c) move inside each part; and shapes (q, k) in its coordinates."""

        def moved(known: tuple[Substructure, slice]) -> tuple[Substructure, Floats]:
            part, modal = known
            if not len(part.inner):
                return part, shapes[modal]
            part, old = part.with_forces(forces[part.inner])
            return part, old.T @ shapes[modal]

        parts, inside = zip(*in_threads(moved, self.each()), strict=True)
        return replace(self, parts=parts), np.vstack([shapes[: len(self.joints)], *inside])

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
    joints: Floats  # banded Cholesky factor (b + 1, j) of the stiffness that the joints feel

    @cached_property
    def blocks(self) -> list[tuple[slice, slice, Floats, Floats]]:
        """Columns of that triangle, some at a time: which are theirs and the next rows, and both.

        By these, solutions take a third of the time of LAPACK's own for bands, which goes through
        the whole band for every right-hand side.
        """
        (width, size), some = self.joints.shape, 128
        padded, blocks = np.vstack([self.joints, np.zeros((1, size))]), []
        for start in range(0, size, some):
            end, last = min(start + some, size), min(start + some + width - 1, size)
            columns = np.arange(start, end)
            below = np.arange(start, last)[:, None] - columns
            dense = padded[np.where((below < 0) | (below >= width), width, below), columns]
            inside, after = np.split(dense, [end - start])
            blocks.append((slice(start, end), slice(end, last), inside, after))
        return blocks

    def apply(self, rhs: Floats) -> Floats:
        """Solve for (q, c)."""
        found = rhs.copy()
        for here, after, triangle, below in self.blocks:
            found[here] = solve_triangular(triangle, found[here], lower=True, check_finite=False)
            found[after] -= below @ found[here]
        for here, after, triangle, below in reversed(self.blocks):
            right = found[here] - below.T @ found[after]
            found[here] = solve_triangular(triangle, right, 1, lower=True, check_finite=False)
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
    """Parts of a frame with their modes up to a frequency, if any; None where they do not pay.

    Raises:
        StructureError: the structure is a mechanism.
    """
    operators = structure.meshed[1]
    terms = (*structure.stiffness_terms, structure.stiffness_constant)
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

    def cut(number: int) -> tuple[Substructure, csc_matrix]:
        """A part whose inside nothing moves yet, and the stiffness between inside and joints."""
        term = terms[number]
        inner = np.flatnonzero(owner == number)
        rows, masses = term[inner], structure.mass[inner]
        coupled = np.diff(masses.indptr) > 0
        border = np.flatnonzero((touched[number] | coupled)[joints])
        at = joints[border]
        alone = replace(
            operators,
            free=operators.free[inner],
            stiffness_terms=(),
            stiffness_constant=rows[:, inner].tocsc(),
            mass=masses[:, inner].tocsc(),
        )
        coupling, held = masses[:, at].tocsc(), term[at][:, at].toarray()
        none = np.zeros((len(inner), 0)), np.zeros(0)
        moved = np.zeros((len(inner), len(at)))
        part = Substructure(inner, border, alone, coupling, moved, held, np.zeros_like(held), *none)
        return part, rows[:, at].tocsc()

    def alike(*pair: tuple[Substructure, csc_matrix]) -> bool:
        matrices = (
            (part.alone.stiffness_constant, part.alone.mass, part.coupling, part.held, between)
            for part, between in pair
        )
        return all(
            left.shape == right.shape
            and (not left.size or abs(left - right).max() <= 1e-12 * abs(left).max())
            for left, right in zip(*matrices, strict=True)
        )

    cuts = in_threads(cut, range(len(terms)))
    # Parts of the same plan, as most stories are, differ by rounding alone and are solved once.
    first = [next(k for k, known in enumerate(cuts) if alike(known, part)) for part in cuts]
    kinds = [k for k in sorted(set(first)) if len(cuts[k][0].inner)]
    once = in_threads(lambda k: cuts[k][0].solved(cuts[k][1], top_hz), kinds)
    known = dict(zip(kinds, once, strict=True))
    parts = tuple(
        replace(known[kind], inner=part.inner, border=part.border) if kind in known else part
        for kind, (part, _) in zip(first, cuts, strict=True)
    )
    return Substructures(structure, parts, joints, structure.mass[joints][:, joints].tocsc())


_SIZES = 40, 60, 80, 100, 120, 140, 160, 180, 200, 230, 260, 300  # shapes that are tried
CHOOSE = 4  # samples that the basis has not seen, by which its size is chosen
CERTIFY, CONFIDENCE = 29, 0.95  # samples that judge the choice: 90 % of the box (Wilks 1941)
_ROUNDS, _JOIN = 3, 8  # of a basis that fails, at most; samples where it fails, that join it
# Samples, and shapes of their responses, whose inertia refines the parts of a structure: with them
# 230 shapes of the six-story frame err by .0049 rms, and by .0043 with all taken from the full one.
_REFINE, _REFINED = 6, 60


@dataclass(frozen=True, eq=False)
class Reduction:
    """A reduced structure and how well it does at parameters that its basis has not seen.

    The checks were drawn evenly from the box after the number of shapes was chosen, and the full
    model was solved at each.
    """

    reduced: ReducedStructure  # the structure on its basis
    rms_error: float = 0.0  # rms difference of ln|H| at the lowest damping, over all checks
    checks: int = 0  # number of samples checked; 0 for what is its own reduction
    worst_error: float = 0.0  # rms difference of ln|H| over floors and grid at the worst of them

    @property
    def model(self) -> ReducedModel:
        """The reduced model."""
        return self.reduced.model

    @property
    def share(self) -> float:
        """Share of the box that is no worse than `worst_error`, with a confidence of 95 %.

        Were the share smaller, n independent draws would all lie in it with a probability below
        share^n = 5 % (Wilks 1941); nothing is assumed of how the errors are distributed.
        """
        return float((1.0 - CONFIDENCE) ** (1.0 / self.checks)) if self.checks else 1.0


def reduce_structure(
    structure: Structure,
    target: ReductionTarget,
    placed: tuple[Placed, ...] = (),
    progress: Progress = SILENT,
) -> Reduction:
    """Reduce a structure on which some effects, or none, act; a stick is its own reduction.

    Args:
        target: what must be met; its box holds stiffness factors, then sizes.

    Raises:
        StructureError: no basis of up to 300 shapes meets the tolerance.
    """
    if structure.is_stick:
        return Reduction(lumped(structure))
    terms = tuple(listed.effect.terms(structure, listed.place) for listed in placed)
    asked = _Question(structure, terms, placed)
    (chosen_seed,), checks = spawn(target.seed, 1), CHOOSE + CERTIFY
    rng = np.random.default_rng(chosen_seed)
    samples, least = log_even_samples(target, len(structure.stiffness_terms)), 0
    whole_only = bool(placed) or len(structure.dashpots) > 0
    space = None if whole_only else _space(structure, target, samples[:_REFINE])
    mass: Any = structure.mass if space is None else space.mass
    taken: Callable[[ReductionTarget, Floats], Floats | Singles]
    taken = partial(_snapshots, asked) if space is None else partial(_driven, space)
    progress.start("Reducing the model", len(samples) + checks)
    # Of many parameters' samples the first make a model, from which the others are a step away.
    first = samples if space is None else samples[:SAMPLES]
    shapes: list[Floats | Singles] = in_threads(partial(taken, target), list(first), progress)
    if space is not None and len(first) < len(samples):
        basis = compressed(mass, shapes, _SIZES[-1])
        model = reduced_on(structure, space.expanded(basis)).model
        weights = [STATIC_WEIGHT * scale for scale, _ in structure.driving]
        loads = np.column_stack([mass @ basis, space.force * weights])
        step = partial(moved_by, space, model, loads, target)
        shapes += in_threads(step, list(samples[len(first) :]), progress)
    for _ in range(_ROUNDS):
        basis = compressed(mass, shapes, _SIZES[-1])
        expanded = basis if space is None else space.expanded(basis)
        reduced = whole = reduced_on(structure, expanded)
        unseen = rng.uniform(target.lower, target.upper, (checks, len(target.lower)))
        judge = partial(_full_log_frf, asked)
        if space is not None:
            judge = partial(_beyond, *space.with_inertia(basis), whole.model)
        full = np.stack(in_threads(partial(judge, target), list(unseen), progress))
        # On the fewest shapes that a few samples do not object to, or on all. A few checks see half
        # as much as many do (50 theta: 1.5 times the rms of four).
        for size in (s for s in _SIZES if least <= s < whole.model.size):
            errors = asked.log_frf(whole.first(size), unseen[:CHOOSE], target) - full[:CHOOSE]
            if np.sqrt((errors**2).mean()) <= 0.5 * target.tolerance:
                reduced = reduced_on(structure, whole.basis[:, :size])
                break
        errors = asked.log_frf(reduced, unseen[CHOOSE:], target) - full[CHOOSE:]
        each = np.sqrt((errors**2).mean(axis=(1, 2)))
        rms = float(np.sqrt((each**2).mean()))
        if rms <= target.tolerance:
            return Reduction(reduced, rms, len(each), float(each.max()))
        least = reduced.model.size + 1
        worst = unseen[CHOOSE + np.argsort(each)[-_JOIN:]]
        progress.start("Reducing the model, on more samples", len(worst) + checks)
        shapes += in_threads(partial(taken, target), list(worst), progress)
    names = ", ".join(effect.label for effect in placed)
    cure = ", lower the top of the frequency grid, or calibrate with --exact"
    raise StructureError(
        f"a reduced model of {reduced.model.size} shapes{' with ' + names if names else ''} still "
        f"differs from the full one by {rms:.2g} rms in ln|H|, more than the tolerance "
        f"{target.tolerance:g}; raise reduction.tolerance"
        f"{cure if names else ' or lower the top of the frequency grid'}"
    )


@dataclass(frozen=True, eq=False)
class _Question:
    """The full model and what its effects add to it."""

    structure: Structure
    terms: tuple[Terms, ...]
    placed: tuple[Placed, ...]

    def log_frf(
        self, reduced: ReducedStructure, samples: Floats, target: ReductionTarget
    ) -> Floats:
        """ln|H| (N, f, k) of a reduced structure at samples (N, p + q), at the lowest damping."""
        terms = tuple(reduced.terms(listed) for listed in self.placed)
        system = System(reduced.model, ConstantDamping(), self.placed, terms)
        return _log_frf(system, samples, target)


def _full(asked: _Question, target: ReductionTarget, sample: Floats) -> DrivenSystem:
    """The full model at one sample (p + q,)."""
    theta, sizes = np.split(sample, [len(asked.structure.stiffness_terms)])
    added = list(zip(asked.placed, asked.terms, strict=True))
    given = asked.structure, added, theta, sizes, target.top_hz, ConstantDamping()
    return driven_system(*given, columns=3 if asked.structure.crossing else 1)


def _full_log_frf(asked: _Question, target: ReductionTarget, sample: Floats) -> Floats:
    """ln|H| (f, k) of the full model at one sample (p + q,), at the lowest damping."""
    sizes = sample[len(asked.structure.stiffness_terms) :]
    return _log_frf(_full(asked, target, sample).system, sizes[None], target)[0]


def _snapshots(asked: _Question, target: ReductionTarget, sample: Floats) -> Singles:
    """Weighted shapes (n, c) of the full model at one sample (p + q,), to take a basis from."""
    structure, found = asked.structure, _full(asked, target, sample)
    omega, shapes = 2.0 * np.pi * found.frequency_hz, found.shapes
    floors, driven = structure.floor_rows @ shapes, shapes.T @ found.equations.force
    dashpots, parts, motions = found.system.model.dashpots, [], [*structure.driving]
    if any(any(terms.flexibility) or terms.pitch for terms in asked.terms):
        # A base that turns moves the roof as one that translates does.
        motions.append((1.0 / structure.levels[-1], np.eye(3)[ROTATION]))
    for scale, motion in motions:
        force = driven @ motion
        felt = FeltModes(omega, scale * force, floors, dashpots)
        static = shapes @ (scale * force / omega**2)
        parts += [shapes @ felt.combinations(target), STATIC_WEIGHT * static[:, None]]
    return np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")


def _log_frf(system: System, samples: Floats, target: ReductionTarget) -> Floats:
    """ln|H| (N, e f, k) at samples (N, p + q) of a system's parameters, at the lowest damping.

    Of the motions that drive it (see `Structure.driving`), one after the other.
    """
    theta, sizes = system.split(torch.from_numpy(samples))
    zeta = torch.full((len(samples),), target.zeta, dtype=torch.float64)
    inputs = Excitation(columns=3 if system.crosses else 1)
    frf = system.respond(inputs, theta, zeta, sizes, torch.from_numpy(target.frequency_hz))
    parts = [frf[:, :, 0]]
    if system.crosses:
        parts.append(frf[:, :, TRANSLATION] + frf[:, :, ACROSS])
    return np.asarray(torch.cat(parts, dim=1).abs().clamp_min(1e-12).log().numpy())


@dataclass(frozen=True, eq=False)
class Space:
    """What shapes are made of: q degrees of freedom, or coordinates of substructures."""

    structure: Structure
    parts: Substructures | None

    @cached_property
    def force(self) -> Floats:
        """(q, e) by which the base drives it, see `Structure.driving`."""
        return self.condensed(self.structure.forces)

    @cached_property
    def rows(self) -> Floats:
        """(f, q) what floors show of it."""
        return self.condensed(self.structure.floor_rows.T).T

    @property
    def mass(self) -> Any:
        """(q, q)."""
        return self.structure.mass if self.parts is None else self.parts

    def at(self, theta: Floats) -> Factored:
        """The stiffness (q, q) at a theta (p,), factorised."""
        if self.parts is not None:
            return self.parts.at(theta)
        return factorize_held(self.structure.meshed[1], self.structure.stiffness(theta))

    def condensed(self, loads: Floats) -> Floats:
        """What loads (n, c) do along it, (q, c)."""
        return loads if self.parts is None else self.parts.condensed(loads)

    def expanded(self, shapes: Floats) -> Floats:
        """Displacements (n, c) of shapes (q, c)."""
        return shapes if self.parts is None else self.parts.expanded(shapes)

    def with_inertia(self, basis: Floats) -> tuple["Space", Floats]:
        """Where one step of inverse iteration from a basis (q, r) leads, and the basis there."""
        if self.parts is None:
            return self, basis
        parts, basis = self.parts.with_inertia(basis)
        return Space(self.structure, parts), basis

    @classmethod
    def of_forces(cls, structure: Structure, forces: Floats) -> "Space":
        """Of parts that follow what forces (n, c) do at rest, where the structure has such."""
        parts = substructures(structure, 0.0)
        if parts is not None:
            parts = parts.with_forces(forces, np.zeros((len(parts.joints), 0)))[0]
        return cls(structure, parts)


def _space(structure: Structure, target: ReductionTarget, thetas: Floats) -> Space:
    """Of parts that follow the structure's responses within the box, where it has such."""
    # Modes of a part are as low as the least factor makes them.
    top_hz = target.top_hz / float(np.sqrt(target.lower.min()))
    space = Space(structure, substructures(structure, top_hz))
    if space.parts is None:
        return space
    shapes = [_driven(space, target, theta) for theta in thetas]
    return space.with_inertia(compressed(space.mass, shapes, _REFINED))[0]


def _driven(space: Space, target: ReductionTarget, theta: Floats) -> Floats:
    """Weighted shapes (q, c) of the response at a theta (p,), to take a basis from."""
    force, rows = space.force, space.rows
    found = driven_shapes(space.at(theta), space.mass, force, rows, target.top_hz)
    omega, floors = 2.0 * np.pi * found.frequency_hz, rows @ found.shapes
    weights = []
    for (scale, _), driven in zip(space.structure.driving, force.T @ found.shapes, strict=True):
        felt = FeltModes(omega, scale * driven, floors)
        static = scale * STATIC_WEIGHT * (driven / omega**2)[:, None]
        weights += [felt.combinations(target), static]
    return combined(found.shapes, np.column_stack(weights))


def moved_by(
    space: Space, reduced: ReducedModel, forces: Floats, target: ReductionTarget, theta: Floats
) -> Singles:
    """Weighted shapes (q, c) at a theta (p,), by one step from a model, to take a basis from.

    Args:
        forces: (q, r + s) of the inertia of the model's shapes, then those whose shapes are wanted.
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


def _beyond(
    space: Space, basis: Floats, model: ReducedModel, target: ReductionTarget, theta: Floats
) -> Floats:
    """ln|H| (e f, k) of the full model at a theta (p,), at the lowest damping.

    Args:
        space: where one step of inverse iteration from a basis (q, r) leads.
        model: on that basis.
    """
    # From the responses of the reduced model and a step from them: in the six-story frame it leaves
    # a tenth of what 230 shapes err by.
    omega, vectors = diagonal(model.stiffness(theta))
    floors = model.floor_shapes
    felt = [FeltModes(omega, force @ vectors, floors @ vectors) for _, force in model.driving]
    # Responses of less energy, of the largest, are left out.
    weights = np.column_stack([each.combinations(target, 1e-5) for each in felt])
    moved = combined(basis, vectors @ weights)
    factors = space.at(theta)
    loads = np.column_stack([symmetric_times(space.mass, moved), space.force])
    fresh, _ = orthonormal(factors.apply(loads), basis, partial(symmetric_times, space.mass))
    held = factors.times(fresh)
    between = along(basis, held)
    both = np.block([[model.stiffness(theta), between], [between.T, fresh.T @ held]])
    omega, vectors = diagonal(both)
    floors = np.column_stack([floors, space.rows @ fresh]) @ vectors
    driven = (
        np.append(old, new) @ vectors
        for (_, old), new in zip(model.driving, space.force.T @ fresh, strict=True)
    )
    return np.concatenate([FeltModes(omega, each, floors).log_frf(target) for each in driven])
