"""Lanczos' method for the largest eigenvalues of K^-1 M, with full reorthogonalisation, no restart.

All Lanczos vectors are kept and made orthogonal to each other in the inner product of M (Parlett
1998, chapter 13). That costs memory, and about a tenth fewer solutions and a quarter of the other
work of ARPACK, which restarts. The vectors are purified by one step of inverse iteration that the
recurrence gives away (Ericsson and Ruhe 1980; Nour-Omid et al. 1987).
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.sparse import csc_matrix

from femupdate.fe.model import Floats

_FIRST_LOOK = 3  # times the number of values wanted, in steps: hardly any converge earlier
_LOOKS = 20  # a share of one in so many steps more between two looks at the convergence
_MEMORY = 1e9  # bytes that the vectors may take
_NOTHING = 1e-13  # of the largest eigenvalue: what is left of a vector is rounding


def most_steps(size: int, count: int) -> int:
    """Steps that are worth trying for so many values of an (n, n) problem, 0 if they need too much.

    Sound problems take 3 to 5 steps a value.
    """
    steps = min(size - 1, 6 * count + 60)
    return steps if 8.0 * size * steps <= _MEMORY else 0


def largest_of_inverse(
    solve: Callable[[Floats], Floats],
    mass: csc_matrix,
    start: Floats,
    count: int,
    tolerance: float,
) -> tuple[Floats, Floats] | None:
    """Largest eigenvalues of K^-1 M with their vectors.

    A value that occurs several times may be found fewer times: count what lies below.

    Args:
        solve: K^-1 times a vector; K is symmetric and positive definite.
        mass: (n, n), positive semidefinite.
        start: (n,) anything with a share of every vector wanted.
        count: how many.
        tolerance: of the residual, relative to each eigenvalue, in the norm of M.

    Returns:
        values (count,), largest first, and vectors (n, count) of unit length in M; None where
        the steps worth trying do not reach the tolerance.
    """
    steps = most_steps(len(start), count)
    basis = np.empty((len(start), steps), order="F")  # what is not written takes no memory
    diagonal, beside = np.zeros(steps), np.zeros(steps)
    vector = solve(mass @ start)
    image = mass @ vector
    length = np.sqrt(vector @ image)
    look = _FIRST_LOOK * count + 8
    for step in range(steps):
        vector, image = vector / length, image / length
        basis[:, step] = vector
        known = basis[:, : step + 1]
        vector = solve(image)
        along = float(image @ vector)
        vector -= along * known[:, -1]
        if step:
            vector -= length * known[:, -2]
        rest = (mass @ vector) @ known  # rounding brings the old vectors back
        vector -= known @ rest
        image = mass @ vector
        squared = float(vector @ image)
        diagonal[step] = along + rest[-1]
        if not squared > (_NOTHING * diagonal[0]) ** 2:
            return None  # the vectors span all that the start reaches
        beside[step] = length = np.sqrt(squared)
        if step + 1 >= min(look, steps):
            found = _ritz(diagonal[: step + 1], beside[: step + 1], count, tolerance)
            if found is not None:
                values, inside = found
                purified = known @ inside + np.outer(vector, inside[-1] / values)
                return values, purified / np.sqrt(1.0 + (length * inside[-1] / values) ** 2)
            look = step + 1 + max(4, step // _LOOKS)
    return None


def _ritz(
    diagonal: Floats, beside: Floats, count: int, tolerance: float
) -> tuple[Floats, Floats] | None:
    """Largest values (count,) of a tridiagonal matrix, vectors (steps, count), if converged."""
    last = len(diagonal) - 1
    values, vectors = eigh_tridiagonal(
        diagonal, beside[:-1], select="i", select_range=(last + 1 - count, last)
    )
    values, vectors = values[::-1], vectors[:, ::-1]
    error = beside[-1] * np.abs(vectors[-1])
    return (values, vectors) if (error <= tolerance * values).all() else None
