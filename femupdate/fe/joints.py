"""Beams that frame into the edge of a shell in its plane, and the rigid links they need.

A moment about the normal of a shell, at a single node, causes a rotation that grows without limit
as the mesh is refined. A coupling beam that ends at a wall's edge would be held less with every
halving of the mesh. So the end face of the beam stays plane: the nodes of the edge over the beam's
depth follow the beam's node as one rigid body. A column along the edge, or a beam that continues
along the shell, carries the moment already, and no link is made.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.fe.elements.beam import Beams
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel, RigidLinks, area_vectors

_IN_PLANE = 0.1  # sine of the angle between beam and shell up to which the beam lies in its plane
_SAME_PLANE = 0.985  # cosine of the angle between shells of one plane
_ALONG = 1e-6  # cosine; a beam along an element's side lies in the element
_SLANT = 0.3  # tangent of the angle between the edge and the beam's end face
_ROUNDING = 1e-6  # of the depth


@dataclass(frozen=True)
class EdgeJoint:
    """The end of a beam at the edge of a shell in its plane."""

    node: int  # of the beam's end
    beam: int  # index of the beam
    across: Floats  # (3,) unit vector along the end face, in the plane of the shell
    depth: float  # of the beam along it, m
    centre: float  # distance of the beam's axis from the node along it, m
    edge: Integers  # (m,) other nodes of the shell's edge on either side of the node
    position: Floats  # (m,) their coordinates along `across` from the node, m, ascending

    @property
    def face(self) -> tuple[float, float]:
        """Lower and upper end of the link along `across` from the node, m.

        At the end of an edge, such as under the roof, the whole depth of the beam is on the side
        where the shell is.
        """
        below, above = bool((self.position < 0.0).any()), bool((self.position > 0.0).any())
        if below and above:
            return self.centre - 0.5 * self.depth, self.centre + 0.5 * self.depth
        return (-self.depth, 0.0) if below else (0.0, self.depth)

    def slaves(self) -> Integers:
        """Nodes to be linked: on either side, those up to the one nearest to the face's end."""
        chosen = np.zeros(len(self.edge), dtype=bool)
        for end, side in zip(self.face, (-1.0, 1.0), strict=True):
            there = np.flatnonzero(self.position * side > 0.0)
            if len(there) and end * side > _ROUNDING * self.depth:
                distance = np.abs(self.position[there])
                last = distance[np.abs(distance - abs(end)).argmin()]
                chosen[there] = distance <= last * (1.0 + _ROUNDING)
        return self.edge[chosen]


def edge_joints(model: FiniteElementModel) -> tuple[EdgeJoint, ...]:
    """Find the ends of beams that need a rigid link over their depth."""
    corners, beams = model.nodes[model.faces], model.elements_of(Beams)
    normal = area_vectors(corners)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.maximum(size, np.finfo(float).tiny)
    sheets = _Sheets(model.faces, normal, corners.mean(axis=1))
    # Braces and the struts of infills end in a point.
    beams = beams.taken(np.flatnonzero(~np.isin(beams.kind, ("brace", "infill"))))
    if not len(sheets.nodes) or not len(beams):
        return ()
    ends = _Ends.of(model.nodes, beams)
    # Nodes where a beam lies in the plane of a shell that has no beam along its sides there.
    around = _ElementsAtNodes(sheets.nodes, len(model.nodes))
    end, sheet = around.pairs(ends.node)
    inside = np.abs(np.einsum("nd,nd->n", ends.away[end], sheets.normal[sheet])) < _IN_PLANE
    end, sheet = end[inside], sheet[inside]
    along = (sheets.nodes[sheet] == ends.other[end, None]).any(axis=1)
    key = ends.node[end] * len(sheets.nodes) + sheet
    candidates = np.unique(ends.node[end[~np.isin(key, key[along])]])
    joints: list[EdgeJoint] = []
    for node in candidates.tolist():
        ends_here = np.flatnonzero(ends.node == node)
        joints += _joints_at(model.nodes, sheets, ends, node, ends_here, around(node))
    return tuple(joints)


def joint_links(model: FiniteElementModel, joints: tuple[EdgeJoint, ...]) -> RigidLinks:
    """Rigid links of all joints.

    A node that belongs to two joints follows the first; a node at a support is not linked.
    """
    taken = {joint.node for joint in joints}
    taken.update(np.flatnonzero(model.fixed.any(axis=1)).tolist())
    masters, slaves = [], []
    for joint in joints:
        for slave in joint.slaves().tolist():
            if slave not in taken:
                taken.add(slave)
                masters.append(joint.node)
                slaves.append(slave)
    tied = np.ones((len(slaves), DOF_PER_NODE), dtype=np.bool_)
    return RigidLinks(np.array(masters, dtype=np.int64), np.array(slaves, dtype=np.int64), tied)


@dataclass(frozen=True)
class _Sheets:
    """Shells and triangles as quadrilaterals (a triangle repeats its last node)."""

    nodes: Integers
    normal: Floats  # (n, 3) unit vectors
    middle: Floats  # (n, 3) means of the corners


@dataclass(frozen=True)
class _Ends:
    """Both ends of all beams: node, other end's node, beam, unit vector away from the node."""

    beams: Beams
    extents: Floats
    node: Integers
    other: Integers
    beam: Integers
    away: Floats

    @classmethod
    def of(cls, points: Floats, beams: Beams) -> "_Ends":
        nodes = beams.nodes
        axis = points[nodes[:, 1]] - points[nodes[:, 0]]
        axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-300)
        return cls(
            beams=beams,
            extents=beams.extents(),
            node=nodes.T.ravel(),
            other=nodes[:, ::-1].T.ravel(),
            beam=np.tile(np.arange(len(nodes)), 2),
            away=np.concatenate([axis, -axis]),
        )


class _ElementsAtNodes:
    """Which elements meet in a node."""

    def __init__(self, nodes: Integers, count: int) -> None:
        self._order = np.argsort(nodes.ravel(), kind="stable")
        self._starts = np.searchsorted(nodes.ravel()[self._order], np.arange(count + 1))
        self._corners = nodes.shape[1]

    def __call__(self, node: int) -> Integers:
        places = self._order[self._starts[node] : self._starts[node + 1]]
        return np.unique(places // self._corners)

    def pairs(self, nodes: Integers) -> tuple[Integers, Integers]:
        """All pairs of a position in a list of nodes and an element at that node, (m,) each."""
        first, count = self._starts[nodes], self._starts[nodes + 1] - self._starts[nodes]
        place = np.repeat(np.arange(len(nodes)), count)
        within = np.arange(len(place)) - np.repeat(np.cumsum(count) - count, count)
        return place, self._order[np.repeat(first, count) + within] // self._corners


def _joints_at(
    points: Floats, sheets: _Sheets, ends: _Ends, node: int, ends_here: Integers, around: Integers
) -> Iterator[EdgeJoint]:
    """Yield the joints of one node: one for each plane in which a beam leaves it."""
    normal = sheets.normal[around]
    left = np.ones(len(around), dtype=bool)
    while left.any():
        first = normal[int(left.argmax())]
        plane = np.abs(normal @ first) > _SAME_PLANE
        left &= ~plane
        quads = sheets.nodes[around[plane]]
        candidates = ends_here[np.abs(ends.away[ends_here] @ first) < _IN_PLANE]
        if not len(candidates) or any(
            _runs_along(points, quads, node, ends.away[end]) for end in candidates
        ):
            continue
        joints = [_joint(points, sheets, quads, ends, int(end), first) for end in candidates]
        joint = max(joints, key=lambda joint: joint.depth)
        if len(joint.edge):
            yield joint


def _runs_along(nodes: Floats, quads: Integers, node: int, away: Floats) -> bool:
    """Whether a direction from a node points into one of the elements around it, sides included."""
    for corners in quads.tolist():
        distinct = list(dict.fromkeys(corners))
        place = distinct.index(node)
        before = nodes[distinct[place - 1]] - nodes[node]
        after = nodes[distinct[(place + 1) % len(distinct)]] - nodes[node]
        backward, forward = before / np.linalg.norm(before), after / np.linalg.norm(after)
        normal = np.cross(forward, backward)
        if (
            np.cross(forward, away) @ normal > -_ALONG
            and np.cross(away, backward) @ normal > -_ALONG
            and away @ (backward + forward) > 0.0
        ):
            return True
    return False


def _joint(
    points: Floats, sheets: _Sheets, quads: Integers, ends: _Ends, end: int, normal: Floats
) -> EdgeJoint:
    beams, beam, node, away = ends.beams, int(ends.beam[end]), int(ends.node[end]), ends.away[end]
    across = np.cross(normal, away)
    across /= np.linalg.norm(across)
    # One sense for all: upwards, or along the greatest component of what lies level.
    lead = across[2] if abs(across[2]) > _ALONG else across[int(np.abs(across).argmax())]
    across = across * np.sign(lead)
    z = beams.up[beam] - (beams.up[beam] @ away) * away
    z = z / np.linalg.norm(z)
    depth = float(np.abs([np.cross(z, away) @ across, z @ across]) @ ends.extents[beam])
    offset = np.zeros(3)
    if beams.offset is not None:
        offset = beams.offset[beam, int(beams.nodes[beam, 1] == node)]
    # Nodes that continue the shell's edge from the node, over the depth or to the next ones.
    near = np.unique(quads)
    reach = max(depth, float(np.linalg.norm(points[near] - points[node], axis=1).max()))
    same = np.abs(sheets.normal @ normal) > _SAME_PLANE
    close = np.abs(sheets.middle - points[node]).max(axis=1) < 3.0 * reach
    # The rim: nodes of the sides that only one of these elements has.
    around = sheets.nodes[same & close]
    sides = np.stack([around, np.roll(around, -1, axis=1)], axis=-1).reshape(-1, 2)
    sides = np.sort(sides[sides[:, 0] != sides[:, 1]], axis=1)
    distinct, count = np.unique(sides, axis=0, return_counts=True)
    candidates = np.setdiff1d(distinct[count == 1], [node])
    arm = points[candidates] - points[node]
    along, aside = arm @ across, np.abs(arm @ away)
    level = np.abs(arm @ normal) < _SLANT * np.abs(along)
    chosen = level & (aside <= _SLANT * np.abs(along)) & (np.abs(along) > _ROUNDING * depth)
    chosen &= (np.abs(along) <= 1.5 * depth) | np.isin(candidates, near)
    order = np.argsort(along[chosen], kind="stable")
    edge, position = candidates[chosen][order], along[chosen][order]
    return EdgeJoint(node, beam, across, depth, float(offset @ across), edge, position)
