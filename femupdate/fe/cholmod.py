"""Sparse Cholesky factors by CHOLMOD (Chen, Davis, Hager and Rajamanickam 2008), if installed.

CHOLMOD comes with `cvxopt`, which is under the GPL; femupdate neither needs nor brings it, and uses
it only where the user has installed it.
"""

import importlib.util
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, tril

from femupdate.arrays import Floats, Integers


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
