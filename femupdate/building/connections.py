"""What joins the nodes of a building beside its elements: diaphragms, a sprung footing, joints."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from femupdate.arrays import Integers
from femupdate.building.lattice import ExtraLines
from femupdate.building.members import SixSprings, Supports
from femupdate.building.mesh_check import piece_of
from femupdate.fe.joints import edge_joints, joint_links
from femupdate.fe.model import CONSTANT, DOF_PER_NODE, FiniteElementModel, RigidLinks, Springs

# What slides or is free is held by its base, which `dynamics.released` lets move.
_HELD = {"fixed": 6, "pinned": 3, "springs": 0, "slides": 6, "free": 6}
_IN_PLAN = np.array([True, True, False, False, False, True])


def connected(
    model: FiniteElementModel,
    base: Integers,
    supports: Supports,
    springs: Iterable[tuple[Integers, SixSprings]],
    diaphragms: Iterable[Integers],
) -> FiniteElementModel:
    """Return the model with its supports and rigid links.

    Args:
        base: (n,) nodes at the base.
        supports: how they are held; a sprung footing adds one node, the last.
        springs: nodes with springs to the ground, which take the place of their support.
        diaphragms: node indices of each slab that is rigid in plan.
    """
    fixed = np.zeros((len(model.nodes), DOF_PER_NODE), dtype=np.bool_)
    fixed[base, : _HELD[supports.base]] = True
    model = replace(model, fixed=fixed)
    footing = RigidLinks()
    if supports.base == "springs":
        model, footing = _on_springs(model, base, supports)
    for nodes, group in springs:
        model = with_springs(model, nodes, group)
    joints = []
    for joint in edge_joints(model):
        if joint.node not in base:  # the base's nodes are left to its support
            keep = ~np.isin(joint.edge, base)
            joints.append(replace(joint, edge=joint.edge[keep], position=joint.position[keep]))
    ties = joint_links(model, tuple(joints))
    plan = diaphragm_links(model, diaphragms, ties.slave)
    # On a diaphragm the slaves of a joint follow in plan already, with the same motion.
    tied = ties.tied & ~(np.isin(ties.slave, plan.slave)[:, None] & _IN_PLAN)
    return replace(model, links=footing.joined(plan, replace(ties, tied=tied)))


def face_lines(model: FiniteElementModel) -> ExtraLines:
    """Return mesh lines through the ends of the faces of beams that frame into shell edges."""
    lines: dict[str, list[float]] = {"x": [], "y": [], "z": []}
    for joint in edge_joints(model):
        axis = int(np.abs(joint.across).argmax())
        for end in joint.face:
            if bool((joint.position * end > 0.0).any()):
                lines["xyz"[axis]].append(float(model.nodes[joint.node, axis] + end))
    return ExtraLines(*(tuple(lines[axis]) for axis in "xyz"))


def _on_springs(
    model: FiniteElementModel, base: Integers, supports: Supports
) -> tuple[FiniteElementModel, RigidLinks]:
    """Return the model with one more node under the middle of the base, on springs."""
    footing = len(model.nodes)
    middle = 0.5 * (model.nodes[base].min(axis=0) + model.nodes[base].max(axis=0))
    held = np.ones((1, DOF_PER_NODE), dtype=np.bool_)
    links = RigidLinks(
        master=np.full(len(base), footing, dtype=np.int64),
        slave=base.astype(np.int64),
        tied=np.ones((len(base), DOF_PER_NODE), dtype=np.bool_),
    )
    nodes = np.concatenate([model.nodes, middle[None]])
    model = replace(model, nodes=nodes, fixed=np.concatenate([model.fixed, held]))
    return with_springs(model, np.array([footing]), supports), links


def with_springs(
    model: FiniteElementModel, nodes: Integers, group: SixSprings
) -> FiniteElementModel:
    """Return the model with springs from nodes (n,) to the ground, free in their directions."""
    given = [k for k, value in enumerate(group.springs) if value is not None]
    count, fixed = len(nodes), model.fixed.copy()
    fixed[nodes[:, None], given] = False
    at_node, way = np.repeat(nodes, len(given)), np.tile(given, count)
    before = model.springs
    springs = Springs(
        nodes=np.concatenate([before.nodes, np.column_stack([at_node, np.full(len(at_node), -1)])]),
        direction=np.concatenate([before.direction, way]),
        stiffness=np.append(before.stiffness, [group.springs[k] or 0.0 for k in way]),
        group=np.append(before.group, np.full(len(way), CONSTANT)),
        damping=np.append(before.dashpots, [group.dashpots[k] or 0.0 for k in way]),
    )
    return replace(model, fixed=fixed, springs=springs)


def diaphragm_links(
    model: FiniteElementModel, slabs: Iterable[Integers], followers: Integers
) -> RigidLinks:
    """Links in plan of slabs; those that share a node are one diaphragm.

    The master is the node nearest to the middle; a follower of something else cannot be it.
    """
    links = []
    pairs = [np.stack([np.full(len(s) - 1, s[0]), s[1:]], axis=1) for s in map(np.unique, slabs)]
    edges = np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs])
    part, joined = piece_of(len(model.nodes), edges), np.unique(edges)
    for label in np.unique(part[joined]):
        nodes = joined[part[joined] == label]
        level = model.nodes[nodes]
        away = np.linalg.norm(level - level.mean(axis=0), axis=1)
        away[np.isin(nodes, followers)] = np.inf
        master = nodes[int(away.argmin())]
        slaves = nodes[nodes != master]
        tied = np.broadcast_to(_IN_PLAN, (len(slaves), DOF_PER_NODE))
        links.append(RigidLinks(np.full(len(slaves), master), slaves, tied.copy()))
    return RigidLinks().joined(*links)
