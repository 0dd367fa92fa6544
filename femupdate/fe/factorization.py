"""Sparse factorisation of symmetric matrices by SciPy's SuperLU, with its residual checked."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU, splu

from femupdate.arrays import Floats, Integers
from femupdate.errors import StructureError
from femupdate.fe.products import symmetric_times

_RESIDUAL = 1e-8  # relative, in coordinates scaled by the diagonal; sound systems give 1e-12
_TOGETHER = 14  # right-hand sides; a column of many takes half as long again, beyond the cache


class SingularMatrixError(StructureError):
    """A matrix that cannot be factorised."""


@dataclass(frozen=True)
class Factorization:
    """A factorised matrix."""

    matrix: csc_matrix  # (n, n) what was factorised, real or complex
    apply: Callable[[Floats], Floats]  # solves (n, ...) without looking at the residual
    factors: SuperLU | None = None  # with pivots on the diagonal; None where rows were exchanged

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
            return None
        return self.factors.U.diagonal().real[self.factors.perm_c]

    def order(self) -> Integers | None:
        """Degrees of freedom as they are eliminated, (n,), which suits every like pattern."""
        return None if self.factors is None else np.argsort(self.factors.perm_c)


def factorize(matrix: csc_matrix, *, ordered: bool = False) -> Factorization:
    """Factorise a symmetric matrix, real or complex.

    Where one cannot be factorised with pivots on the diagonal, rows are exchanged as well.

    Args:
        ordered: whether rows and columns come in a good order of elimination; finding one takes a
            quarter of the time.

    Raises:
        SingularMatrixError: no factorisation solves a system with it.
    """
    matrix = csc_matrix(matrix)
    probe = np.random.default_rng(20240).standard_normal(matrix.shape[0]).astype(matrix.dtype)
    attempts: tuple[Callable[[], Factorization], ...] = (
        lambda: _by_superlu(matrix, ordered),
        lambda: Factorization(matrix, _some_at_a_time(splu(matrix))),
    )
    for attempt in attempts:
        try:
            result = attempt()
        except (RuntimeError, ArithmeticError):  # a zero pivot
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
