"""Sparse factorisation of symmetric matrices, with its residual checked."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU, splu

from femupdate.errors import ModelError
from femupdate.fe.model import Floats

_RESIDUAL = 1e-8  # relative, in coordinates scaled by the diagonal; sound systems give 1e-12
_SEED = 20240


class SingularMatrixError(ModelError):
    """A matrix that cannot be factorised."""


@dataclass(frozen=True)
class Factorization:
    """A factorised matrix.

    Attributes:
        matrix: (n, n) what was factorised, real or complex.
        factors: SuperLU's factors.
        pivoted: True where rows were exchanged, so that the pivots' signs mean nothing.
    """

    matrix: csc_matrix
    factors: SuperLU
    pivoted: bool

    def apply(self, rhs: Floats) -> Floats:
        """Solve without looking at the residual, (n, ...) -> (n, ...)."""
        return self.factors.solve(rhs)

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
        """Diagonal of the factors by degree of freedom, (n,), or None after row exchanges.

        As many are negative as the matrix has negative eigenvalues (Sylvester's law of inertia).
        """
        if self.pivoted:
            return None
        return self.factors.U.diagonal().real[self.factors.perm_c]


def factorize(matrix: csc_matrix) -> Factorization:
    """Factorise a symmetric matrix, real or complex.

    The diagonal pivots in the order of minimum degree suit stiffness matrices; where an indefinite
    or complex matrix does not bear that, rows are exchanged as well.

    Raises:
        SingularMatrixError: no factorisation solves a system with it.
    """
    matrix = csc_matrix(matrix)
    probe = np.random.default_rng(_SEED).standard_normal(matrix.shape[0]).astype(matrix.dtype)
    for pivoted in (False, True):
        try:
            result = Factorization(matrix, _factors(matrix, pivoted), pivoted)
        except RuntimeError:  # SuperLU met a pivot that is exactly zero
            continue
        if result.residual(result.apply(probe), probe) < _RESIDUAL:
            return result
    raise SingularMatrixError("the matrix is singular to working precision")


def _factors(matrix: csc_matrix, pivoted: bool) -> SuperLU:
    if pivoted:
        return splu(matrix)
    return splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
