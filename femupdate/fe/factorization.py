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
from typing import Any, Literal

import numpy as np
from scipy.sparse import csc_matrix, tril
from scipy.sparse.linalg import SuperLU, splu

from femupdate.arrays import Floats, Integers
from femupdate.errors import StructureError
from femupdate.fe.products import symmetric_times

Backend = Literal["superlu", "cholmod"]
ENVIRONMENT = "FEMUPDATE_SPARSE"

_RESIDUAL = 1e-8  # relative, in coordinates scaled by the diagonal; sound systems give 1e-12
_TOGETHER = 14  # right-hand sides; a column of many takes half as long again, beyond the cache


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


def default_backend() -> Backend:
    """The fastest backend at hand for positive definite matrices.

    The environment variable FEMUPDATE_SPARSE=superlu keeps to SciPy.
    """
    if os.environ.get(ENVIRONMENT, "").lower() == "superlu":
        return "superlu"
    return "cholmod" if cholmod_is_there() else "superlu"


class SingularMatrixError(StructureError):
    """A matrix that cannot be factorised."""


@dataclass(frozen=True)
class Factorization:
    """A factorised matrix."""

    matrix: csc_matrix  # (n, n) what was factorised, real or complex
    apply: Callable[[Floats], Floats]  # solves (n, ...) without looking at the residual
    factors: SuperLU | None = None  # with pivots on the diagonal; None by CHOLMOD
    exchanged: bool = False  # whether rows were

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
        if self.factors is None:
            return None if self.exchanged else np.ones(self.matrix.shape[0])
        return self.factors.U.diagonal().real[self.factors.perm_c]

    def order(self) -> Integers | None:
        """Degrees of freedom as they are eliminated, (n,), which suits every like pattern."""
        return None if self.factors is None else np.argsort(self.factors.perm_c)


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
        ordered: whether rows and columns come in a good order of elimination; finding one takes a
            quarter of the time.

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
    attempts: tuple[Callable[[], Factorization], ...] = (
        lambda: _by_cholmod(matrix),
        lambda: _by_superlu(matrix, ordered),
        lambda: Factorization(matrix, _some_at_a_time(splu(matrix)), exchanged=True),
    )
    for attempt in attempts[0 if cholesky else 1 :]:
        try:
            result = attempt()
        except (RuntimeError, ArithmeticError):  # a zero pivot; not positive definite
            continue
        if result.residual(result.apply(probe), probe) < _RESIDUAL:
            return result
    raise SingularMatrixError("the matrix is singular to working precision")


def _by_superlu(matrix: csc_matrix, ordered: bool) -> Factorization:
    """Factors L U: diagonal pivots in the order of minimum degree suit symmetric matrices."""
    factors = splu(
        matrix,
        permc_spec="NATURAL" if ordered else "MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        panel_size=4,  # SuperLU's own choice of 20 columns is a third slower on shells
        options={"SymmetricMode": True},
    )
    return Factorization(matrix, _some_at_a_time(factors), factors)


def _some_at_a_time(factors: SuperLU) -> Callable[[Floats], Floats]:
    def solve(rhs: Floats) -> Floats:
        if rhs.ndim == 1 or rhs.shape[1] <= _TOGETHER:
            return factors.solve(rhs)
        some = range(0, rhs.shape[1], _TOGETHER)
        return np.hstack([factors.solve(rhs[:, k : k + _TOGETHER]) for k in some])

    return solve


def _by_cholmod(matrix: csc_matrix) -> Factorization:
    """Factors L L^T, from the lower triangle."""
    cvxopt: Any = importlib.import_module("cvxopt")
    cholmod: Any = importlib.import_module("cvxopt.cholmod")
    lower = tril(matrix, format="coo")
    rows, columns = lower.row.astype(np.int64), lower.col.astype(np.int64)
    entries = cvxopt.spmatrix(lower.data, rows, columns, matrix.shape)
    factors = cholmod.symbolic(entries)
    cholmod.numeric(entries, factors)

    def solve(rhs: Floats) -> Floats:
        by_column = np.asarray(rhs, dtype=np.float64).reshape(len(rhs), -1)
        solution = cvxopt.matrix(np.asfortranarray(by_column))
        cholmod.solve(factors, solution)
        return np.array(solution).reshape(rhs.shape)

    return Factorization(matrix, solve)
