"""Block Lanczos method for the largest eigenvalues of K^-1 M: all vectors kept, no restart.

The vectors are made orthogonal to all others in the inner product of M (Parlett 1998, chapter 13;
blocks: Golub and Underwood 1977). That costs memory, and fewer solutions and less other work than
ARPACK, which restarts. The result is purified by one step of inverse iteration that the recurrence
gives away (Ericsson and Ruhe 1980; Nour-Omid, Parlett, Ericsson and Jensen 1987).
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh, solve_triangular
from scipy.sparse import csc_matrix

from femupdate.fe.model import Floats

_MANY = 30  # values wanted from which blocks pay
_BLOCK = 4  # vectors; a factor is passed through memory once for all of them
_FIRST_LOOK = 1.4  # times the number of values wanted, in vectors: none converge earlier
_LOOKS = 20  # a share of one in so many vectors more between two looks at the convergence
_MEMORY = 1e9  # bytes that the vectors may take
_UNEVEN = 1e-2  # of the largest: a pivot so small means that one pass leaves a skewed block


def block_size(count: int) -> int:
    """Vectors in a block for so many values."""
    return 1 if count < _MANY else _BLOCK


def most_vectors(size: int, count: int) -> int:
    """Vectors that are worth trying for an (n, n) problem, 0 if they need too much memory.

    Sound problems take 2 to 5 a value.
    """
    vectors = min(size - block_size(count), 6 * count + 60)
    return vectors if 8.0 * size * vectors <= _MEMORY else 0


def largest_of_inverse(
    solve: Callable[[Floats], Floats],
    mass: csc_matrix,
    start: Floats,
    count: int,
    tolerance: float,
) -> tuple[Floats, Floats] | None:
    """Largest eigenvalues of K^-1 M with their vectors.

    A value that occurs more often than a block is wide may be found fewer times: count what lies
    below.

    Args:
        solve: K^-1 times (n, b); K is symmetric and positive definite.
        mass: (n, n), positive semidefinite.
        start: (n, b) anything with a share of every vector wanted.
        count: how many.
        tolerance: of the residual, relative to each eigenvalue, in the norm of M.

    Returns:
        values (count,), largest first, and vectors (n, count) of unit length in M; None where
        the vectors worth trying do not reach the tolerance.
    """
    size, width = start.shape
    most = most_vectors(size, count)
    basis = np.empty((size, most), order="F")  # what is not written takes no memory
    small = np.zeros((most, most))
    look = int(_FIRST_LOOK * count) + 20
    done = 0
    try:
        block, image, link = _orthonormal(solve(mass @ start), mass)
        while done + width <= most:
            new = slice(done, done + width)
            basis[:, new] = block
            known = basis[:, : done + width]
            ahead = solve(image)
            along = image.T @ ahead
            ahead -= block @ along
            if done:
                old = slice(done - width, done)
                small[new, old] = link
                ahead -= basis[:, old] @ link.T
            rest = known.T @ (mass @ ahead)  # rounding brings the old vectors back
            ahead -= known @ rest
            small[new, new] = along + rest[new]
            block, image, link = _orthonormal(ahead, mass)
            done += width
            if done >= min(look, most - width):
                found = _converged(small[:done, :done], link, count, tolerance)
                if found is not None:
                    return _purified(known, block @ link, *found)
                look = done + max(4, done // _LOOKS)
    except np.linalg.LinAlgError:
        pass  # the vectors span all that the start reaches
    return None


def _orthonormal(vectors: Floats, mass: csc_matrix) -> tuple[Floats, Floats, Floats]:
    """Orthonormal block in M, M times it, and what turns the block into the given vectors.

    Raises:
        LinAlgError: the vectors depend on each other.
    """
    whole = np.eye(vectors.shape[1])
    while True:
        image = mass @ vectors
        factor = np.linalg.cholesky(vectors.T @ image).T
        inverse = solve_triangular(factor, np.eye(len(factor)))
        vectors, image = np.asfortranarray(vectors @ inverse), np.asfortranarray(image @ inverse)
        whole = factor @ whole
        pivots = factor.diagonal()
        if pivots.min() > _UNEVEN * pivots.max():
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


def _purified(
    known: Floats, ahead: Floats, values: Floats, inside: Floats
) -> tuple[Floats, Floats]:
    """One step of inverse iteration on the Ritz vectors: K^-1 M X = X theta + ahead y."""
    vectors = known @ inside + ahead @ (inside[-ahead.shape[1] :] / values)
    return values, vectors
