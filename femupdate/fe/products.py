"""Products of long matrices, as the libraries below do them fastest."""

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats


def symmetric_times(matrix: csc_matrix, shapes: Floats) -> Floats:
    """A symmetric sparse matrix (n, n) times shapes (n, m).

    Its columns are its rows: taken as these the product is three times as fast.
    """
    return np.asarray(matrix.T @ np.ascontiguousarray(shapes))


def combined(shapes: Floats, weights: Floats) -> Floats:
    """Combinations (n, c) of shapes (n, m) by weights (m, c).

    With the long side last BLAS is up to three times as fast.
    """
    return (weights.T @ shapes.T).T


def along(shapes: Floats, forces: Floats) -> Floats:
    """What forces (n, c) do along shapes (n, m), (m, c); likewise."""
    return (forces.T @ shapes).T


def orthonormal(fresh: Floats, basis: Floats, mass: csc_matrix) -> tuple[Floats, Floats]:
    """Vectors (n, c) orthonormal in the mass to each other and to a basis, and mass times them."""
    moved = symmetric_times(mass, fresh)
    before = np.einsum("ij,ij->j", fresh, moved)
    scale = 1.0 / np.sqrt(np.where(before > 0.0, before, 1.0))
    fresh, moved = fresh * scale, moved * scale
    # K^-1 M is symmetric in the mass: but for rounding, it leads from a block to that before it, to
    # itself and on. What rounding has brought along the others goes in the second pass.
    for known in (basis[:, -2 * fresh.shape[1] :], basis):
        askew = along(known, moved)
        fresh = fresh - combined(known, askew)
        # Without so little along others, unit vectors are as long as before to the last digit.
        if known is basis and np.abs(askew).max(initial=0.0) < 1e-9:
            break
        moved = symmetric_times(mass, fresh)
        energy, directions = np.linalg.eigh(fresh.T @ moved)
        # A direction with a smaller share of a block's energy adds nothing new.
        kept = energy > 1e-12
        onto = directions[:, kept] / np.sqrt(energy[kept])
        fresh, moved = fresh @ onto, moved @ onto
    return fresh, moved
