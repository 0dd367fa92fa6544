"""Shapes that span responses, and bases made of them.

Most modes of a building with slabs are vertical slab modes that a horizontal base motion hardly
drives. A basis is therefore taken from responses: to the base motion, and to a force at each
observed floor (the dual problem: a Galerkin FRF errs by the product of the two errors), over the
whole frequency grid, each frequency weighted by how small the response of the floors is there,
since it is the logarithm that must be right. The most energetic directions among the weighted
responses are the basis (proper orthogonal decomposition).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.arrays import Complexes, Floats, Singles
from femupdate.fe.products import symmetric_times
from femupdate.seeds import even_points
from femupdate.workers import return_memory

# Samples from which the basis is taken, at least, and for every parameter: with them 200 shapes of
# the six-story frame err by .0041 rms, and by .0036 with 48.
SAMPLES, _SAMPLES_EACH = 32, 2
TOP = 1.3  # times the top of the grid: up to where responses are right that shapes are taken from
STATIC_WEIGHT = 1e-2  # of the static response among the shapes
_LEAST_NEW = 1e-13  # energy of a shape, of the largest, that is kept


@dataclass(frozen=True)
class ReductionTarget:
    """What a reduced model must reproduce."""

    lower: Floats  # (p,) prior box of the parameters: stiffness factors, then sizes of effects
    upper: Floats
    frequency_hz: Floats  # (k,) grid
    zeta: float  # lowest damping ratio of interest, the hardest
    tolerance: float  # rms difference of ln|H| allowed, over floors, grid and unseen parameters
    # parameter samples that the basis is taken from; None for the usual number
    samples: int | None = None
    seed: int = 0  # of samples and checks

    @property
    def top_hz(self) -> float:
        """Up to where responses are right that shapes are taken from."""
        return TOP * float(self.frequency_hz[-1])


@dataclass(frozen=True, eq=False)
class FeltModes:
    """Modes as base and floors feel them, at one sample."""

    omega: Floats  # (m,) circular frequencies, rad/s
    participation: Floats  # (m,) participation factors
    floors: Floats  # (f, m) floor shapes
    dashpots: Floats | None = None  # (j, m) stretch of dashpots of one N s/m each
    # (f, 1) what the modes lack of the floors' static displacement, s2
    missed: Floats | float = 0.0

    def log_frf(self, target: ReductionTarget) -> Floats:
        """ln|H| (f, k) of the floors, at the lowest damping."""
        omega, w = self.omega[:, None], 2.0 * np.pi * target.frequency_hz
        moved = w**2 / (omega**2 - w**2 + 2j * target.zeta * omega * w)
        frf = 1.0 + (self.floors * self.participation) @ moved
        return np.asarray(np.log(np.abs(frf).clip(1e-12)))

    def combinations(self, target: ReductionTarget, least: float = 1e-9) -> Floats:
        """Weighted combinations (m, c) of the modes that span their responses over the grid.

        Args:
            least: energy of a combination, of the largest, that is kept.
        """
        omega, w = self.omega[:, None], 2.0 * np.pi * target.frequency_hz[::2]
        moved = np.asarray(1.0 / (omega**2 - w**2 + 2j * target.zeta * omega * w), np.complex128)
        driven = self._moved(self.participation, moved, w)
        if self.dashpots is None:
            frf = 1.0 + (self.floors * self.participation) @ (w**2 * moved)
        else:
            frf = 1.0 + self.floors @ (w**2 * driven)
        # A frequency weighs no more where |H| is smaller.
        size = np.abs(frf + self.missed * w**2).clip(1e-3)
        primal = driven * (w**2 / size.min(axis=0))
        # Duals matter less than the motion itself: a twentieth of its weight was best of those
        # tried.
        dual = [
            self._moved(0.05**0.5 * shape, moved, w) * (w**2 / width)
            for shape, width in zip(self.floors, size, strict=True)
        ]
        sides = (np.concatenate([b.real, b.imag], axis=1) for b in (primal, *dual))
        energy, directions = eigh(sum(side @ side.T for side in sides))
        kept = energy > least * energy[-1]
        return directions[:, kept] * np.sqrt(energy[kept] / energy[-1])

    def _moved(self, load: Floats, moved: Complexes, w: Floats) -> Complexes:
        """Modes (m, k) under a load (m,), from what unit loads move each and the dashpots hold."""
        free, rows = load[:, None] * moved, self.dashpots
        if rows is None:
            return free
        between = np.einsum("im,mk,jm->kij", rows, moved, rows, optimize=True)
        held = np.eye(len(rows)) / (1j * w[:, None, None]) + between
        forces = np.linalg.solve(held, (rows @ free).T[:, :, None])[:, :, 0].T
        return np.asarray(free - moved * (rows.T @ forces))


def compressed(mass: csc_matrix, shapes: Sequence[Floats | Singles], size: int) -> Floats:
    """Mass-orthonormal basis (n, r) of weighted shapes, most energetic first.

    The shapes are seen through random combinations of them, half as many again as are wanted; what
    is lost with the rest is of the size of the shapes beyond the basis (Halko, Martinsson and Tropp
    2011, SIAM Review 53, theorem 10.6).

    Args:
        shapes: parts (n, c) each, which are never copied into one array: they may fill GB. Single
            precision does: energies go down to 1e-13 of the largest with it.
    """
    return_memory()  # of the threads that made the shapes
    count = sum(block.shape[1] for block in shapes)
    # At least 40 combinations more than the basis has shapes.
    width, rng = min(size + max(size // 2, 40), count), np.random.default_rng(11)
    mixed = np.zeros((len(shapes[0]), width))
    for block in shapes:
        mixed += block @ rng.standard_normal((block.shape[1], width), dtype=np.float32)
    span = _orthonormal(mass, mixed)
    forces = symmetric_times(mass, span).T
    single = forces.astype(np.float32)
    parts = [(single if block.dtype == np.float32 else forces) @ block for block in shapes]
    seen = np.concatenate(parts, axis=1, dtype=np.float64)
    energy, directions = eigh(seen @ seen.T)
    kept = np.flatnonzero(energy > _LEAST_NEW * energy[-1])[::-1][:size]
    return span @ directions[:, kept]


def _orthonormal(mass: csc_matrix, vectors: Floats) -> Floats:
    """Basis (n, r), orthonormal in the mass, of what vectors (n, c) span."""
    energy, directions = eigh(vectors.T @ symmetric_times(mass, vectors))
    kept = energy > _LEAST_NEW * energy[-1]
    vectors = vectors @ (directions[:, kept] / np.sqrt(energy[kept]))
    # Once more: the energies span many decades and the first pass loses orthogonality with them.
    factor = np.linalg.cholesky(vectors.T @ symmetric_times(mass, vectors))
    return np.asarray(vectors @ np.linalg.inv(factor).T)


def log_even_samples(target: ReductionTarget, stories: int | None = None) -> Floats:
    """Samples (n, p + q) for the basis.

    Soft stories have most modes below the top of the grid: stiffness factors are even in their
    logarithm, sizes by themselves.

    Args:
        stories: p; all parameters are factors where None.
    """
    size = len(target.lower)
    count = target.samples or max(SAMPLES, _SAMPLES_EACH * size)
    unit = even_points(count, size, target.seed)
    even = target.lower + (target.upper - target.lower) * unit
    low, high = np.log(target.lower[:stories]), np.log(target.upper[:stories])
    even[:, :stories] = np.exp(low + (high - low) * unit[:, :stories])
    return even
