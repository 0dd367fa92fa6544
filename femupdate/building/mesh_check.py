"""Says in words what is wrong with a mesh before anything is computed, and what hangs together."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from femupdate.arrays import Floats, Integers, Strings
from femupdate.building.entry import Complaint, Point
from femupdate.fe.model import FiniteElementModel, area_vectors


def piece_of(count: int, edges: Integers) -> Integers:
    """Return the number of the piece that each of `count` nodes belongs to, given edges (e, 2)."""
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def loose_pieces(count: int, cells: Iterable[Integers], base: Integers) -> list[Integers]:
    """Return the nodes of each piece without a path of elements down to the base, largest first.

    Args:
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


def nodes_at(model: FiniteElementModel, points: Sequence[Point], key: str) -> Integers:
    """Return the nodes (n,) nearest to points; Complaint further than the longest element is."""
    sides = model.nodes[np.concatenate([model.lines, model.faces[:, :2]])]
    reach = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1).max()
    away, nearest = cKDTree(model.nodes).query(np.array(points))
    for number, node in enumerate(nearest.tolist()):
        if away[number] > reach:
            where, close = place(np.array(points[number])), place(model.nodes[node])
            text = f"{where} lies outside of the building, whose nearest node is at {close}"
            raise Complaint(f"{key}[{number}]", f"{text}; correct it")
    return np.asarray(nearest)


LEVEL = 1e-3  # m; what is nearer than this to a floor's level is on it


def stories_of_nodes(model: FiniteElementModel, levels: Floats) -> Integers:
    """Return the story of each node, (N,): the one at whose floor it lies, else the first at it.

    Nodes of no element go with the nearest one of an element.

    Args:
        model: whose groups are stories.
        levels: (stories,) of the floors, m.
    """
    none = len(levels)
    story = np.full((2, len(model.nodes)), none)
    for block in model.elements:
        mine = np.where(block.group < 0, none, block.group)
        for nodes in block.nodes.T:
            at = np.abs(model.nodes[nodes, 2] - np.append(levels, np.inf)[mine]) < LEVEL
            np.minimum.at(story[0], nodes[at], mine[at])
            np.minimum.at(story[1], nodes, mine)
    merged = np.where(story[0] < none, story[0], story[1])
    known = np.flatnonzero(merged < none)
    return np.asarray(merged[known[cKDTree(model.nodes[known]).query(model.nodes)[1]]])


UPRIGHT = 0.9  # vertical component of the axis of what is a column, of the normal of a slab
_SAME = 1e-6  # of the structure's size: nodes nearer than this are in the same place
_KEY = "mesh.file"


def merge_nodes(nodes: Floats, distance: float) -> Integers:
    """Return the node that stands for each node, (N,); a chain of near ones is one."""
    number = np.arange(len(nodes))
    pairs = cKDTree(nodes).query_pairs(distance, output_type="ndarray")
    if not len(pairs):
        return number
    piece = piece_of(len(nodes), pairs)
    _, first = np.unique(piece, return_index=True)
    return first[piece]


def cell_kinds(points: Floats) -> Strings:
    """What cells (n, k, 3) are by their direction: "column", "beam", "slab" or "wall"."""
    if points.shape[1] == 2:
        axis = points[:, 1] - points[:, 0]
        steep = np.abs(axis[:, 2]) > UPRIGHT * np.linalg.norm(axis, axis=1)
        return np.where(steep, "column", "beam").astype("<U24")
    normal = area_vectors(points)
    level = np.abs(normal[:, 2]) > UPRIGHT * np.linalg.norm(normal, axis=1)
    return np.where(level, "slab", "wall").astype("<U24")


def check_elements(
    nodes: Floats,
    cells: Mapping[str, Integers],
    *,
    doubles_allowed: bool,
    names: Integers | Strings | None = None,
) -> None:
    """Refuse a mesh with elements that cannot be.

    Args:
        cells: node indices of "line", "triangle" and "quad" cells.
        doubles_allowed: whether unmerged nodes in one place are meant.
        names: (N,) numbers of the nodes in the file; from 0 on where None.
    """
    names = np.arange(len(nodes)) if names is None else names
    for kind, corners in cells.items():
        _refuse_degenerate(nodes, kind, corners, names)
        if corners.shape[1] > 3:
            _refuse_crossed(nodes, kind, corners, names)
        double = first_double(corners)
        if double is not None:
            later, earlier = double
            where = place(nodes[corners[later]].mean(axis=0))
            text = f"{kind} {later} lies on {kind} {earlier} at {where}; remove one of the two"
            raise Complaint(_KEY, text)
    used = np.unique(np.concatenate([corners.ravel() for corners in cells.values()]))
    if not doubles_allowed:
        distance = _SAME * float(np.ptp(nodes[used], axis=0).max())
        pairs = cKDTree(nodes[used]).query_pairs(distance, output_type="ndarray")
        if len(pairs):
            first, second = used[np.sort(pairs[0])]
            raise Complaint(
                _KEY,
                f"{len(pairs)} pairs of nodes are in the same place, such as nodes {first} and "
                f"{second} at {place(nodes[first])}: the elements there are not connected; write "
                'mesh.merge = "1 mm" to merge them, or "0 m" where the gap is meant',
            )
    _refuse_hanging(nodes, cells, used, names)


def check_connected(nodes: Floats, cells: Sequence[Integers], base: Integers) -> None:
    """Refuse a mesh of which a piece has no way down to the base.

    Args:
        cells: node indices of the elements of each type, (n, k).
        base: (b,) nodes at the base.
    """
    pieces = loose_pieces(len(nodes), cells, base)
    if pieces:
        biggest = pieces[0]
        counted = "1 piece is" if len(pieces) == 1 else f"{len(pieces)} pieces are"
        raise Complaint(
            _KEY,
            f"{counted} not connected to the base, such as {len(biggest)} nodes around "
            f"{place(nodes[biggest[0]])}; "
            "join the nodes where the parts meet (mesh.merge merges near ones)",
        )


def _name(kind: str, number: int, corners: Integers, names: Integers | Strings) -> str:
    return f"{kind} {number} (nodes {', '.join(map(str, names[corners[number]].tolist()))})"


def _refuse_degenerate(
    nodes: Floats, kind: str, corners: Integers, names: Integers | Strings
) -> None:
    points = nodes[corners]
    if corners.shape[1] == 2:
        size = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
        bad = ~(size > _SAME * np.ptp(nodes, axis=0).max())
        what = "has no length"
    else:
        area = np.linalg.norm(area_vectors(points), axis=1)
        longest = np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2).max(axis=1)
        # Against rounding: an area over the square of the longest diagonal.
        bad = ~(area > 1e-4 * longest**2)
        what = "has no area: it is flat, or its nodes do not go around it"
    bad |= (np.diff(np.sort(corners, axis=1), axis=1) == 0).any(axis=1)
    if bad.any():
        first = int(bad.argmax())
        where = place(points[first].mean(axis=0))
        others = f" (and {int(bad.sum()) - 1} more)" if bad.sum() > 1 else ""
        raise Complaint(
            _KEY,
            f"{_name(kind, first, corners, names)} at {where} {what}{others}; "
            "correct the mesh there",
        )


def _refuse_crossed(nodes: Floats, kind: str, corners: Integers, names: Integers | Strings) -> None:
    points = nodes[corners]
    mean = area_vectors(points)
    ahead, back = np.roll(points, -1, axis=1) - points, np.roll(points, 1, axis=1) - points
    turn = np.einsum("nkd,nd->nk", np.cross(ahead, back), mean)
    bad = (turn <= 0.0).any(axis=1)
    if bad.any():
        first = int(bad.argmax())
        where = place(points[first].mean(axis=0))
        raise Complaint(
            _KEY,
            f"{_name(kind, first, corners, names)} at {where} is inverted: its sides cross or a "
            "corner points inwards; list its nodes in order around a convex quadrilateral",
        )


def _refuse_hanging(
    nodes: Floats, cells: Mapping[str, Integers], used: Integers, names: Integers | Strings
) -> None:
    """Refuse nodes that lie inside a side of an element without being its corner."""
    sides = []
    for corners in cells.values():
        pairs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1)
        sides.append((pairs[:, :1] if corners.shape[1] == 2 else pairs).reshape(-1, 2))
    side = np.unique(np.sort(np.concatenate(sides), axis=1), axis=0)
    ends = nodes[side]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    near = cKDTree(nodes[used]).query_ball_point(ends.mean(axis=1), 0.499 * length)
    counts = np.array([len(nearby) for nearby in near])
    if not counts.any():
        return
    which = np.repeat(np.arange(len(side)), counts)
    node = used[np.concatenate([np.array(nearby, dtype=np.int64) for nearby in near])]
    axis = (ends[which, 1] - ends[which, 0]) / length[which, None]
    arm = nodes[node] - ends[which, 0]
    aside = np.linalg.norm(arm - np.einsum("nd,nd->n", arm, axis)[:, None] * axis, axis=1)
    # A node nearer than a thousandth of a side's length lies on it.
    bad = (aside < 1e-3 * length[which]) & ~(node[:, None] == side[which]).any(axis=1)
    if bad.any():
        first = int(bad.argmax())
        a, b = side[which[first]]
        raise Complaint(
            _KEY,
            f"node {names[node[first]]} at {place(nodes[node[first]])} lies on the side between "
            f"nodes {names[a]} and {names[b]} but is no corner there ({int(bad.sum())} such "
            "places): the elements are not connected; let both sides of a line have the same nodes",
        )
