"""Sparse factorisation of symmetric matrices, with its residual checked.

SciPy's SuperLU always works. CHOLMOD (Chen, Davis, Hager and Rajamanickam 2008) factorises positive
definite matrices 2.7 times as fast, and solves with them 1.4 to 2 times as fast. It comes with
`cvxopt`, which is under the GPL; femupdate neither needs nor brings it, and uses it only where the
user has installed it.
"""

import importlib.util
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, Protocol

import numpy as np
from scipy.sparse import csc_matrix, tril
from scipy.sparse.linalg import SuperLU, splu

from femupdate.arrays import Floats, Integers
from femupdate.errors import StructureError
from femupdate.fe.products import symmetric_times


@cache
def cholmod_is_there() -> bool:
    """Whether cvxopt is installed and can be imported."""
    if importlib.util.find_spec("cvxopt") is None:
        return False
    try:
        importlib.import_module("cvxopt.cholmod")
    except ImportError:
        return False
    return True


class CholmodFactors:
    """L L^T of a real, symmetric and positive definite matrix.

    Args:
        matrix: (n, n); its lower triangle is read.

    Raises:
        ArithmeticError: the matrix is not positive definite.
    """

    def __init__(self, matrix: csc_matrix) -> None:
        self._cvxopt: Any = importlib.import_module("cvxopt")
        self._cholmod: Any = importlib.import_module("cvxopt.cholmod")
        self._size = matrix.shape[0]
        lower = tril(matrix, format="coo")
        rows, columns = lower.row.astype(np.int64), lower.col.astype(np.int64)
        entries = self._cvxopt.spmatrix(lower.data, rows, columns, matrix.shape)
        self._factors = self._cholmod.symbolic(entries)
        self._cholmod.numeric(entries, self._factors)

    def solve(self, rhs: Floats) -> Floats:
        """Solve for one or more right-hand sides, (n,) or (n, m)."""
        columns = np.asarray(rhs, dtype=np.float64).reshape(self._size, -1)
        solution = self._cvxopt.matrix(np.asfortranarray(columns))
        self._cholmod.solve(self._factors, solution)
        return np.array(solution).reshape(rhs.shape)

    def pivots(self) -> Floats:
        """Signs of the pivots, (n,): all positive."""
        return np.ones(self._size)

    def order(self) -> Integers | None:
        """None: CHOLMOD keeps it to itself."""
        return None


Backend = Literal["superlu", "cholmod"]
ENVIRONMENT = "FEMUPDATE_SPARSE"

_RESIDUAL = 1e-8  # relative, in coordinates scaled by the diagonal; sound systems give 1e-12
_TOGETHER = 14  # right-hand sides; a column of many takes half as long again, beyond the cache


class SingularMatrixError(StructureError):
    """A matrix that cannot be factorised."""


class Factors(Protocol):
    """Factors of a matrix, as a backend computes them."""

    def solve(self, rhs: Floats) -> Floats:
        """Solve for one or more right-hand sides, (n,) or (n, m)."""
        ...

    def pivots(self) -> Floats | None:
        """As `Factorization.pivots`."""
        ...

    def order(self) -> Integers | None:
        """As `Factorization.order`."""
        ...


class SuperLUFactors:
    """Factors L U by SciPy.

    The diagonal pivots in the order of minimum degree suit symmetric matrices.

    Args:
        matrix: (n, n), real or complex.
        pivoted: whether to exchange rows.
        ordered: whether rows and columns come in a good order of elimination; finding one takes a
            quarter of the time.

    Raises:
        RuntimeError: a pivot is exactly zero.
    """

    def __init__(self, matrix: csc_matrix, pivoted: bool = False, ordered: bool = False) -> None:
        self._pivoted = pivoted
        # SuperLU's own choice of 20 columns at a time is a third slower on shells.
        self._factors: SuperLU = (
            splu(matrix)
            if pivoted
            else splu(
                matrix,
                permc_spec="NATURAL" if ordered else "MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                panel_size=4,
                options={"SymmetricMode": True},
            )
        )

    def solve(self, rhs: Floats) -> Floats:
        """Solve for one or more right-hand sides, (n,) or (n, m)."""
        if rhs.ndim == 1 or rhs.shape[1] <= _TOGETHER:
            return self._factors.solve(rhs)
        some = range(0, rhs.shape[1], _TOGETHER)
        return np.hstack([self._factors.solve(rhs[:, k : k + _TOGETHER]) for k in some])

    def pivots(self) -> Floats | None:
        """Diagonal of U by degree of freedom, (n,), or None after row exchanges."""
        if self._pivoted:
            return None
        return self._factors.U.diagonal().real[self._factors.perm_c]

    def order(self) -> Integers | None:
        """Degrees of freedom as they are eliminated, (n,), or None after row exchanges."""
        return None if self._pivoted else np.argsort(self._factors.perm_c)


@dataclass(frozen=True)
class Factorization:
    """A factorised matrix."""

    matrix: csc_matrix  # (n, n) what was factorised, real or complex
    factors: Factors  # by one of the backends

    def apply(self, rhs: Floats) -> Floats:
        """Solve without looking at the residual, (n, ...) -> (n, ...)."""
        return self.factors.solve(rhs)

    def times(self, shapes: Floats) -> Floats:
        """The matrix times shapes (n, m)."""
        return symmetric_times(self.matrix, shapes)

    def solve(self, rhs: Floats) -> Floats:
        """Solve and check, (n, ...) -> (n, ...).

        Raises:
            SingularMatrixError: the residual is too large for the solution to be trusted.
        """
        solution = self.apply(rhs)
        error = self.residual(solution, rhs)
        if not error < _RESIDUAL:
            raise SingularMatrixError(
                f"the linear system was solved with a relative residual of {error:.1e}; the "
                "structure is almost a mechanism or its stiffnesses differ by too many orders"
            )
        return solution

    def residual(self, solution: Floats, rhs: Floats) -> float:
        """Largest backward error of a solution's columns, scaled by the diagonal."""
        diagonal = np.abs(self.matrix.diagonal())
        scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)).reshape(-1, *[1] * (rhs.ndim - 1))
        left = np.linalg.norm((self.matrix @ solution - rhs) / scale, axis=0)
        size = np.linalg.norm(scale * solution, axis=0) + np.linalg.norm(rhs / scale, axis=0)
        error = np.divide(left, size, out=np.zeros_like(left), where=size != 0.0)
        return float(np.max(error, initial=0.0)) if np.isfinite(error).all() else np.inf

    def pivots(self) -> Floats | None:
        """Pivots by degree of freedom, (n,), or None after row exchanges.

        Only their signs have a meaning: as many are negative as the matrix has negative
        eigenvalues (Sylvester's law of inertia).
        """
        return self.factors.pivots()

    def order(self) -> Integers | None:
        """Degrees of freedom as they are eliminated, (n,), where that is known.

        It suits every matrix with about the same pattern.
        """
        return self.factors.order()


def default_backend() -> Backend:
    """The fastest backend at hand for positive definite matrices.

    The environment variable FEMUPDATE_SPARSE=superlu keeps to SciPy.
    """
    if os.environ.get(ENVIRONMENT, "").lower() == "superlu":
        return "superlu"
    return "cholmod" if cholmod_is_there() else "superlu"


def factorize(
    matrix: csc_matrix,
    *,
    definite: bool = True,
    backend: Backend | None = None,
    ordered: bool = False,
) -> Factorization:
    """Factorise a symmetric matrix, real or complex.

    SuperLU takes what CHOLMOD refuses. Where an indefinite or complex matrix cannot be factorised
    with pivots on the diagonal, rows are exchanged as well.

    Args:
        definite: False where the matrix is known not to be positive definite.
        backend: to try first; default the fastest at hand.
        ordered: whether rows and columns come in a good order of elimination.

    Raises:
        SingularMatrixError: no factorisation solves a system with it.
        StructureError: the backend is not installed.
    """
    matrix = csc_matrix(matrix)
    probe = np.random.default_rng(20240).standard_normal(matrix.shape[0]).astype(matrix.dtype)
    chosen = backend or default_backend()
    if chosen == "cholmod" and not cholmod_is_there():
        raise StructureError("CHOLMOD is not installed; install cvxopt or use the backend superlu")
    cholesky = chosen == "cholmod" and definite and not np.iscomplexobj(matrix.data)
    attempts: list[Callable[[], Factors]] = []
    if cholesky:
        attempts.append(lambda: CholmodFactors(matrix))
    attempts += [
        lambda: SuperLUFactors(matrix, ordered=ordered),
        lambda: SuperLUFactors(matrix, pivoted=True),
    ]
    for attempt in attempts:
        try:
            result = Factorization(matrix, attempt())
        except (RuntimeError, ArithmeticError):  # a zero pivot; not positive definite
            continue
        if result.residual(result.apply(probe), probe) < _RESIDUAL:
            return result
    raise SingularMatrixError("the matrix is singular to working precision")
