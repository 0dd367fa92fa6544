"""What hangs together in a set of nodes, and which elements lie on each other."""

from collections.abc import Iterable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from femupdate.arrays import Floats, Integers


def piece_of(count: int, edges: Integers) -> Integers:
    """Return the number of the piece that each of `count` nodes belongs to, given edges (e, 2)."""
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def loose_pieces(count: int, cells: Iterable[Integers], base: Integers) -> list[Integers]:
    """Return the nodes of each piece without a path of elements down to the base, largest first.

    Args:
        count: number of nodes.
        cells: nodes of the elements of each type, (n, k).
        base: (b,) nodes at the base.
    """
    edges = np.concatenate([quads[:, [0, k]] for quads in cells for k in range(1, quads.shape[1])])
    piece, used = piece_of(count, edges), np.unique(edges)
    loose = used[~np.isin(piece[used], piece[base])]
    pieces = [loose[piece[loose] == label] for label in np.unique(piece[loose])]
    return sorted(pieces, key=len, reverse=True)


def first_double(nodes: Integers) -> tuple[int, int] | None:
    """Return the first of the elements (n, k) that has the nodes of another, and that one."""
    ordered = np.sort(nodes, axis=1)
    _, first, inverse = np.unique(ordered, axis=0, return_index=True, return_inverse=True)
    earlier = first[inverse.ravel()]
    double = np.flatnonzero(earlier != np.arange(len(nodes)))
    return (int(double[0]), int(earlier[double[0]])) if len(double) else None


def place(point: Floats) -> str:
    """Return a point's coordinates as text: "(1.5, 0, 3.2) m"."""
    return f"({', '.join(f'{value:.4g}' for value in point)}) m"
