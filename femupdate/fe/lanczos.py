"""Block Lanczos method for the largest eigenvalues of K^-1 M: all vectors kept, no restart.

The vectors are orthogonal in the inner product of M (Parlett 1998, chapter 13; blocks: Golub and
Underwood 1977). The recurrence alone keeps them so until rounding has cost half of the digits; the
small matrix needs no more than half (Simon 1984). Then two blocks in turn are made orthogonal to
all others. Keeping all vectors costs memory, but takes fewer solutions and less other work than
ARPACK, which restarts. The results are improved by one step of inverse iteration, which the
recurrence gives for nothing (Ericsson and Ruhe 1980; Nour-Omid, Parlett, Ericsson and Jensen 1987).
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh, solve_triangular
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats
from femupdate.fe.products import along, combined, symmetric_times

_BLOCK = 4  # vectors; a solution with all of them reads the factor from memory once
_PROBES = 4  # random combinations of the vectors, to which a new one must be orthogonal


def block_size(count: int) -> int:
    """Vectors in a block where so many values are wanted."""
    # From thirty values on blocks are faster than single vectors.
    return 1 if count < 30 else _BLOCK


def most_vectors(size: int, count: int, width: int) -> int:
    """Largest number of vectors to try for an (n, n) problem, 0 if they need too much memory.

    Usual problems take 2 to 5 per value, and twice as many in blocks of sixteen.
    """
    each = 2 if width > _BLOCK else 1
    # The vectors may take a gigabyte.
    wanted, room = min(size - width, (6 * count + 60) * each), int(1e9 / (8.0 * size))
    # Five vectors a value suffice as a rule: memory for fewer is not worth a try.
    return min(wanted, room) if room >= min(wanted, 5 * count * each) else 0


def largest_of_inverse(
    solve: Callable[[Floats], Floats], mass: csc_matrix, start: Floats, count: int, tolerance: float
) -> tuple[Floats, Floats] | None:
    """Largest eigenvalues of K^-1 M with their vectors.

    An eigenvalue that is repeated more often than a block has vectors may be found fewer times, so
    callers count the eigenvalues below.

    Args:
        solve: K^-1 times (n, b); K is symmetric and positive definite.
        mass: (n, n), positive semidefinite.
        start: (n, b) any vectors that are orthogonal to none of those wanted.
        tolerance: of the residual, relative to each eigenvalue, in the norm of M.

    Returns:
        values (count,), largest first, and vectors (n, count) of unit length in M; None where
        the largest number of vectors does not reach the tolerance.
    """
    size, width = start.shape
    most = most_vectors(size, count, width)
    # None converge before there are 1.4 vectors a value wanted.
    look = int(1.4 * count) + 20
    try:
        steps = _Recurrence(solve, mass, start, most)
        while steps.done + width <= most:
            steps.advance()
            if steps.done >= min(look, most - width):
                pairs = _converged(steps.inside, steps.link, count, tolerance)
                if pairs is not None:
                    # One step of inverse iteration: K^-1 M X = X theta + ahead y.
                    ahead, (values, inside) = steps.block @ steps.link, pairs
                    rest = ahead @ (inside[-ahead.shape[1] :] / values)
                    return values, steps.known @ inside + rest
                # Between two checks of the convergence the vectors grow by one in twenty.
                look = steps.done + max(2, steps.done // 20)
    except np.linalg.LinAlgError:
        pass  # the vectors span all that the start reaches
    return None


class _Recurrence:
    """The vectors so far, at most `most`, the small matrix on them, and the next block."""

    def __init__(
        self, solve: Callable[[Floats], Floats], mass: csc_matrix, start: Floats, most: int
    ) -> None:
        self._solve, self._mass = solve, mass
        # Columns that are never written take no memory.
        self._basis = np.empty((len(start), most), order="F")
        self._small = np.zeros((most, most))
        self._watch = _Watch(len(start))
        self._again = False  # whether this block is the second of two that are made orthogonal
        self.done = 0
        self.block, self._image, self.link = _orthonormal(solve(symmetric_times(mass, start)), mass)

    @property
    def known(self) -> Floats:
        """Vectors (n, done)."""
        return self._basis[:, : self.done]

    @property
    def inside(self) -> Floats:
        """The small matrix (done, done); its lower half counts."""
        return self._small[: self.done, : self.done]

    def advance(self) -> None:
        """Keep the block, and make the next."""
        block, image, width = self.block, self._image, self.block.shape[1]
        new = slice(self.done, self.done + width)
        self._basis[:, new] = block
        self._watch.add(image)
        ahead = self._solve(image)
        inside = image.T @ ahead
        ahead -= block @ inside
        if self.done:
            old = slice(self.done - width, self.done)
            self._small[new, old] = self.link
            ahead -= self._basis[:, old] @ self.link.T
        rest = image.T @ ahead
        ahead -= block @ rest
        self._small[new, new] = inside + rest
        self.done += width
        following = _orthonormal(ahead, self._mass)
        overlaps = self._watch.overlaps(following[0])
        if self._again or overlaps:
            askew = along(self.known, following[1])
            ahead = following[0] - combined(self.known, askew)
            clean = _orthonormal(ahead, self._mass)
            following = (*clean[:2], clean[2] @ following[2])
        self._again = overlaps and not self._again
        self.block, self._image, self.link = following


class _Watch:
    """Tells by a few random mixtures of old vectors when new ones are not orthogonal to them."""

    def __init__(self, size: int) -> None:
        self._signs = np.random.default_rng(20240)
        self._sum = np.zeros((size, _PROBES), order="F")

    def add(self, image: Floats) -> None:
        """Include M times new vectors (n, b)."""
        signs = self._signs.choice([-1.0, 1.0], (image.shape[1], _PROBES))
        for probe, row in zip(self._sum.T, signs.T, strict=True):
            for column, sign in zip(image.T, row, strict=True):
                (np.add if sign > 0.0 else np.subtract)(probe, column, out=probe)

    def overlaps(self, block: Floats) -> bool:
        """Whether vectors (n, b) are no longer orthogonal to those that are known."""
        # Vectors are made orthogonal again once they have lost half of all digits.
        return bool(np.abs(self._sum.T @ block).max() > 1e-8)


def _orthonormal(vectors: Floats, mass: csc_matrix) -> tuple[Floats, Floats, Floats]:
    """Orthonormal block in M, M times it, and what turns the block into the given vectors."""
    if vectors.shape[1] == 1:
        image = symmetric_times(mass, vectors)
        squared = float(vectors[:, 0] @ image[:, 0])
        if not squared > 0.0:
            raise np.linalg.LinAlgError("a vector without mass")
        length = np.sqrt(squared)
        return vectors / length, image / length, np.array([[length]])
    whole = np.eye(vectors.shape[1])
    while True:
        image = symmetric_times(mass, vectors)
        factor = np.linalg.cholesky(vectors.T @ image).T
        inverse = solve_triangular(factor, np.eye(len(factor)))
        vectors, image = np.asfortranarray(vectors @ inverse), np.asfortranarray(image @ inverse)
        whole = factor @ whole
        pivots = factor.diagonal()
        # With less even pivots one pass does not make a block orthonormal.
        if pivots.min() > 1e-2 * pivots.max():
            return vectors, image, whole


def _converged(
    small: Floats, link: Floats, count: int, tolerance: float
) -> tuple[Floats, Floats] | None:
    """Largest values (count,) of the small matrix (lower half read) and its vectors (m, count)."""
    last = len(small) - 1
    if last + 1 < count:
        return None
    values, vectors = eigh(small, subset_by_index=(last + 1 - count, last))
    values, vectors = values[::-1], vectors[:, ::-1]
    error = np.linalg.norm(link @ vectors[-len(link) :], axis=0)
    return (values, vectors) if (error <= tolerance * values).all() else None
