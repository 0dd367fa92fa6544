"""A basis on which given effects act over a whole box of stiffness factors and sizes.

A basis that serves every effect of the catalogue over the whole prior has many hundred shapes; for
the few effects that a building lists some two hundred do. They are taken from responses at samples
of stiffness factors and sizes together, as those of `femupdate.dynamics.reduction` are at samples
of stiffness factors, and are judged at others by the response with the effects.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from scipy.linalg import solve_triangular
from scipy.sparse import csc_matrix
from scipy.stats import qmc

from femupdate.arrays import Floats
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import EffectSystem, ReducedStructure, reduce_terms
from femupdate.dynamics.full_response import FloorModes, FullModes
from femupdate.dynamics.reduction import TOP, ReductionTarget, snapshots
from femupdate.effects.effect import UNSCALED, Placed, Terms
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.errors import ModelError
from femupdate.fe.driven import driven_shapes
from femupdate.fe.factorization import factorize
from femupdate.processors import everywhere
from femupdate.progress import SILENT, Progress

_SIZES = (40, 60, 80, 100, 120, 140, 160, 180, 200, 230, 260, 300)
_CHOOSE = 4  # unseen samples by which the number of shapes is chosen
_CERTIFY = 29  # others by which the choice is judged
_ROUNDS = 3
_JOIN = 8  # of them whose responses join the basis where it fails


@dataclass(frozen=True, eq=False)
class BoxReduction:
    """A reduced structure and how well it does with its effects at samples that it has not seen.

    Attributes:
        reduced: the structure on its basis.
        rms_error: rms difference of ln|H| at the lowest damping, over all checks.
        worst_error: rms difference at the worst of them.
        checks: number of samples checked; 0 for a stick, which is its own reduction.
    """

    reduced: ReducedStructure
    rms_error: float = 0.0
    worst_error: float = 0.0
    checks: int = 0


@dataclass(frozen=True, eq=False)
class _Sample:
    """The full model at one sample, on shapes that give its response.

    Attributes:
        shapes: (n, c) weighted, to take a basis from.
        log_frf: (f, k) with the effects, at the lowest damping.
    """

    shapes: Floats
    log_frf: Floats


def reduce_over_box(
    structure: Structure,
    placed: tuple[Placed, ...],
    target: ReductionTarget,
    progress: Progress = SILENT,
) -> BoxReduction:
    """Reduce a structure on which some effects act.

    Args:
        structure: the full model.
        placed: the effects; none that makes modes complex.
        target: what must be met; its box holds stiffness factors, then sizes.
        progress: a bar of full solutions.

    Raises:
        ModelError: no basis of up to 300 shapes meets the tolerance.
    """
    if structure.operators is None:
        return BoxReduction(structure_on(structure, np.diag(structure.points.mass**-0.5)))
    rng = np.random.default_rng(target.seed + 1)
    first = _samples(target, len(structure.stiffness_terms))
    asked = _Question(structure, tuple(p.effect.terms(structure, p.place) for p in placed), placed)
    progress.start("Reducing the model with its effects", len(first) + _CHOOSE + _CERTIFY)

    def solved(samples: Floats) -> list[_Sample]:
        found = []
        for one in everywhere(partial(_solve, asked, target), list(samples), len(structure.axis)):
            found.append(one)
            progress.advance()
        return found

    shapes = [one.shapes for one in solved(first)]
    least = 0
    for last in (*[False] * (_ROUNDS - 1), True):
        basis = _compress(structure, np.concatenate(shapes, axis=1))
        unseen = _unseen(target, rng)
        full = solved(unseen)
        chosen = _smallest(asked, basis, least, unseen[:_CHOOSE], full[:_CHOOSE], target)
        reduced = structure_on(structure, basis[:, :chosen])
        each = _errors(asked, reduced, unseen[_CHOOSE:], full[_CHOOSE:], target)
        rms = float(np.sqrt((each**2).mean()))
        if rms <= target.tolerance:
            return BoxReduction(reduced, rms, float(each.max()), len(each))
        if last:
            break
        least = chosen + 1
        more = _CHOOSE + _CERTIFY
        progress.start("Reducing the model with its effects, on more samples", more)
        shapes += [full[_CHOOSE + k].shapes for k in np.argsort(each)[-_JOIN:]]
    names = ", ".join(one.label for one in placed)
    raise ModelError(
        f"a reduced model of {chosen} shapes with {names} still differs from the full one by "
        f"{rms:.2g} rms in ln|H|, more than the tolerance {target.tolerance:g}; raise "
        "reduction.tolerance, lower the top of the frequency grid, or calibrate with --exact"
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
        """ln|H| (N, f, k) at samples (N, p + q), at the lowest damping."""
        terms = tuple(reduce_terms(reduced, one) for one in self.terms)
        system = EffectSystem(reduced, ConstantDamping(), self.placed, terms)
        stories, both = reduced.model.parameters, torch.from_numpy(samples)
        zeta = torch.full((len(samples),), target.zeta, dtype=torch.float64)
        grid = torch.from_numpy(target.frequency_hz)
        frf = system.frf(both[:, :stories], zeta, both[:, stories:], grid)
        return np.asarray(frf.abs().clamp_min(1e-12).log().numpy())


def _solve(asked: _Question, target: ReductionTarget, sample: Floats) -> _Sample:
    """Shapes and response of the full model at one sample (p + q,)."""
    structure = asked.structure
    theta, sizes = np.split(sample, [len(structure.stiffness_terms)])
    stiffness, mass, force = structure.stiffness(theta), structure.mass, structure.rigid_force
    # Effects that a surrogate knows scale with their first parameter alone.
    first = np.cumsum([0, *(len(one.effect.parameters) for one in asked.placed)])
    for terms, start, one in zip(asked.terms, first, asked.placed, strict=False):
        size = float(sizes[start]) if one.effect.parameters else 0.0
        for story, matrix in terms.stiffness:
            stiffness = stiffness + size * (1.0 if story == UNSCALED else theta[story]) * matrix
        if terms.mass is not None:
            mass = mass + size * terms.mass.matrix
            force = force + size * terms.mass.force
    if not any(any(terms.flexibility) or terms.pitch for terms in asked.terms):
        force = force[:, [TRANSLATION]]
    top = TOP * float(target.frequency_hz[-1])
    factors = factorize(csc_matrix(stiffness))
    found = driven_shapes(factors, csc_matrix(mass), force, structure.floor_rows, top)
    omega, shapes = 2.0 * np.pi * found.frequency_hz, found.shapes
    exact = structure_on(structure, _orthonormal(structure, shapes))
    log_frf = asked.log_frf(exact, sample[None], target)[0]
    weighted = _weighted(structure, omega, shapes, force, target)
    return _Sample(weighted, log_frf)


def _weighted(
    structure: Structure, omega: Floats, shapes: Floats, force: Floats, target: ReductionTarget
) -> Floats:
    """Shapes (n, c) weighted by what they do under the motions of the base."""
    floors = structure.floor_rows @ shapes
    driven = shapes.T @ force
    felt = FloorModes(omega, floors * driven[:, TRANSLATION], np.zeros((len(floors), 0)))
    parts = []
    # A base that turns moves the roof as one that translates does.
    for scale, own in zip((1.0, 1.0 / structure.levels[-1]), driven.T, strict=False):
        share = scale * own
        static = shapes @ (share / omega**2)
        parts.append(snapshots(FullModes(shapes, share, floors, static, felt), target))
    return np.concatenate(parts, axis=1)


def _smallest(
    asked: _Question,
    basis: Floats,
    least: int,
    samples: Floats,
    full: list[_Sample],
    target: ReductionTarget,
) -> int:
    """The fewest shapes from `least` up that a few samples do not object to, or all."""
    for size in (s for s in _SIZES if least <= s < basis.shape[1]):
        reduced = structure_on(asked.structure, basis[:, :size])
        each = _errors(asked, reduced, samples, full, target)
        # A few checks see half as much as many do.
        if np.sqrt((each**2).mean()) <= 0.5 * target.tolerance:
            return size
    return basis.shape[1]


def _errors(
    asked: _Question,
    reduced: ReducedStructure,
    samples: Floats,
    full: list[_Sample],
    target: ReductionTarget,
) -> Floats:
    """Rms difference of ln|H| (N,) from the full model."""
    ours = asked.log_frf(reduced, samples, target)
    truth = np.stack([one.log_frf for one in full])
    return np.sqrt(((ours - truth) ** 2).mean(axis=(1, 2)))


def _samples(target: ReductionTarget, stories: int) -> Floats:
    """Samples (n, p + q) for the basis: factors even in their logarithm, sizes by themselves."""
    sobol = qmc.Sobol(len(target.lower), seed=np.random.default_rng(target.seed))
    # The sequence is balanced over powers of two only.
    power = max(target.samples - 1, 0).bit_length()
    unit = sobol.random_base2(power)[: target.samples]
    even = target.lower + (target.upper - target.lower) * unit
    low, high = np.log(target.lower[:stories]), np.log(target.upper[:stories])
    even[:, :stories] = np.exp(low + (high - low) * unit[:, :stories])
    return even


def _unseen(target: ReductionTarget, rng: np.random.Generator) -> Floats:
    """Samples (n, p + q) for checks, even over the box."""
    unit = rng.random((_CHOOSE + _CERTIFY, len(target.lower)))
    return target.lower + (target.upper - target.lower) * unit


def _compress(structure: Structure, shapes: Floats) -> Floats:
    """Mass-orthonormal basis (n, r) of weighted shapes, most energetic first."""
    energy, directions = np.linalg.eigh(shapes.T @ (structure.mass @ shapes))
    kept = np.flatnonzero(energy > 1e-14 * energy[-1])[::-1][: _SIZES[-1]]
    return _orthonormal(structure, shapes @ (directions[:, kept] / np.sqrt(energy[kept])))


def _orthonormal(structure: Structure, shapes: Floats) -> Floats:
    """The shapes made orthonormal in the mass, in their order."""
    factor = np.linalg.cholesky(shapes.T @ (structure.mass @ shapes))
    return np.asarray(solve_triangular(factor, shapes.T, lower=True).T)
