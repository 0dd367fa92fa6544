"""Products of long matrices, as the libraries below do them fastest."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats
from femupdate.errors import StructureError


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


def orthonormal(
    fresh: Floats, basis: Floats, weigh: Callable[[Floats], Floats], moved: Floats | None = None
) -> tuple[Floats, Floats]:
    """Vectors (n, c) orthonormal in the mass to each other and to a basis, and mass times them."""
    moved = weigh(fresh) if moved is None else moved  # mass times the fresh ones
    before = np.einsum("ij,ij->j", fresh, moved)
    scale = 1.0 / np.sqrt(np.where(before > 0.0, before, 1.0))
    fresh, moved = fresh * scale, moved * scale
    total = np.eye(fresh.shape[1])
    # K^-1 M is symmetric in the mass: but for rounding, it leads from a block to that before it, to
    # itself and on. What rounding has brought along the others goes in the second pass.
    for known in (basis[:, -2 * fresh.shape[1] :], basis):
        askew = along(known, moved)
        fresh = fresh - combined(known, askew)
        # With so little along others, and grown so little, unit vectors stay so to the last digit.
        clean = np.abs(askew).max(initial=0.0) < 1e-9 and np.abs(total).max(initial=0.0) < 1e3
        if known is basis and clean:
            break
        moved = weigh(fresh)
        energy, directions = np.linalg.eigh(fresh.T @ moved)
        onto = directions / np.sqrt(np.maximum(energy, 1e-30))
        # What has grown a million times from a block of unit vectors adds nothing new.
        kept = np.square(total @ onto).sum(axis=0) < 1e12
        fresh, moved, total = (part @ onto[:, kept] for part in (fresh, moved, total))
    return fresh, moved


def diagonal(stiffness: Floats) -> tuple[Floats, Floats]:
    """Circular frequencies (k,) and modes (k, k) of a stiffness (k, k) on shapes of unit mass."""
    # Of its inverse the largest are the lowest modes, which rounding then leaves alone.
    try:
        inverse, modes = eigh(np.eye(len(stiffness)), 0.5 * (stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        raise StructureError("a negative stiffness pushes the structure away; raise it") from None
    omega = 1.0 / np.sqrt(inverse[::-1])
    return omega, modes[:, ::-1] * omega
