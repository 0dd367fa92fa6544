"""Shapes that span responses, and bases made of them.

Most modes of a building with slabs are vertical slab modes that a horizontal base motion hardly
drives. A basis is therefore taken from responses: to the base motion, and to a force at each
observed floor (the dual problem: a Galerkin FRF errs by the product of the two errors), over the
whole frequency grid, each frequency weighted by how small the response of the floors is there,
since it is the logarithm that must be right. The responses are compressed by their weighted Gram
matrix (proper orthogonal decomposition).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from scipy.linalg import eigh, solve_triangular
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Singles
from femupdate.dynamics.thresholds import REDUCTION
from femupdate.seeds import even_points

TOP = 1.3  # times the top of the grid: up to where responses are right that shapes are taken from
STATIC_WEIGHT = 1e-2  # of the static response among the shapes
# Duals matter less than the motion itself: a twentieth of its weight was best of those tried.
_DUAL = 0.05
_SMALLEST = 1e-3  # |H| below which a frequency weighs no more
_TOGETHER = 4  # parts that are multiplied at once
_LEAST_NEW = 1e-14  # energy of a shape, of the largest, that is kept


@dataclass(frozen=True)
class ReductionTarget:
    """What a reduced model must reproduce.

    Attributes:
        lower, upper: (p,) prior box of the parameters: stiffness factors, then sizes of effects.
        frequency_hz: (k,) grid.
        zeta: lowest damping ratio of interest, the hardest.
        tolerance: rms difference of ln|H| allowed, over floors, grid and unseen parameters.
        samples: parameter samples that the basis is taken from; None for the usual number.
        seed: of samples and checks.
    """

    lower: Floats
    upper: Floats
    frequency_hz: Floats
    zeta: float
    tolerance: float
    samples: int | None = None
    seed: int = 0

    @property
    def top_hz(self) -> float:
        """Up to where responses are right that shapes are taken from."""
        return TOP * float(self.frequency_hz[-1])


@dataclass(frozen=True, eq=False)
class FeltModes:
    """Modes as base and floors feel them, at one sample.

    Attributes:
        omega: (m,) circular frequencies, rad/s.
        participation: (m,) participation factors.
        floors: (f, m) floor shapes.
        missed: (f,) what the modes lack of the floors' static displacement, s2.
    """

    omega: Floats
    participation: Floats
    floors: Floats
    missed: Floats

    def combinations(self, target: ReductionTarget, least: float = 1e-9) -> Floats:
        """Weighted combinations (m, c) of the modes that span their responses over the grid.

        Args:
            least: energy of a combination, of the largest, that is kept.
        """
        omega, w = self.omega[:, None], 2.0 * np.pi * target.frequency_hz[::2]
        moved = 1.0 / (omega**2 - w**2 + 2j * target.zeta * omega * w)
        frf = 1.0 + (self.floors * self.participation) @ (w**2 * moved)
        size = np.abs(frf + self.missed[:, None] * w**2).clip(_SMALLEST)
        primal = self.participation[:, None] * moved * (w**2 / size.min(axis=0))
        dual = [
            _DUAL**0.5 * shape[:, None] * moved * (w**2 / one)
            for shape, one in zip(self.floors, size, strict=True)
        ]
        gram = sum((c @ c.conj().T).real for c in (primal, *dual))
        energy, directions = eigh(gram)
        kept = energy > least * energy[-1]
        return directions[:, kept] * np.sqrt(energy[kept] / energy[-1])


def compressed(mass: csc_matrix, shapes: Sequence[Floats | Singles], size: int) -> Floats:
    """Mass-orthonormal basis (n, r) of weighted shapes, most energetic first.

    Args:
        mass: (n, n).
        shapes: parts (n, c) each, which are never copied into one array: they may fill GB. Single
            precision does: energies go down to 1e-14 of the largest with it.
        size: r at most.
    """
    energy, directions = eigh(_lower_gram(mass, shapes), lower=True)
    kept = np.flatnonzero(energy > _LEAST_NEW * energy[-1])[::-1][:size]
    weights = directions[:, kept] / np.sqrt(energy[kept])
    basis = np.zeros((mass.shape[0], len(kept)))
    for block, own in _blocks(shapes):
        basis += block @ weights[own]
    # Once more: the energies span many decades and the first pass loses orthogonality with them.
    factor = np.linalg.cholesky(basis.T @ (mass @ basis))
    return np.asarray(solve_triangular(factor, basis.T, lower=True).T)


def _lower_gram(mass: csc_matrix, shapes: Sequence[Floats | Singles]) -> Floats:
    """(c, c) products of all shapes with the mass; those above the diagonal need not be there."""
    count = sum(one.shape[1] for one in shapes)
    gram = np.zeros((count, count))
    for number, (block, own) in enumerate(_blocks(shapes)):
        forces = mass @ block
        for later, rows in _blocks(shapes, number):
            gram[rows, own] = later.T @ forces
    return gram


def _blocks(shapes: Sequence[Floats | Singles], first: int = 0) -> Iterator[tuple[Floats, slice]]:
    """Some parts side by side (n, b), in double precision, and where they are among all shapes.

    Args:
        first: block from which on they are given.
    """
    ends = [0, *accumulate(one.shape[1] for one in shapes)]
    for start in range(first * _TOGETHER, len(shapes), _TOGETHER):
        some = shapes[start : start + _TOGETHER]
        yield (
            np.concatenate(some, axis=1, dtype=np.float64),
            slice(ends[start], ends[start + len(some)]),
        )


def log_even_samples(target: ReductionTarget, stories: int | None = None) -> Floats:
    """Samples (n, p + q) for the basis.

    Soft stories have most modes below the top of the grid: stiffness factors are even in their
    logarithm, sizes by themselves.

    Args:
        target: box and number.
        stories: p; all parameters are factors where None.
    """
    size = len(target.lower)
    count = target.samples or max(REDUCTION.samples, REDUCTION.samples_each * size)
    unit = even_points(count, size, target.seed)
    even = target.lower + (target.upper - target.lower) * unit
    low, high = np.log(target.lower[:stories]), np.log(target.upper[:stories])
    even[:, :stories] = np.exp(low + (high - low) * unit[:, :stories])
    return even
