"""A mesh twice as fine: every surface in four, every line in two, in place."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array, vstack

from femupdate.arrays import Flags, Integers
from femupdate.building.building_mesh import BuildingMesh
from femupdate.fe.elements.beam import Beams
from femupdate.fe.joints import edge_joints, joint_links
from femupdate.fe.model import DOF_PER_NODE, Elements, FiniteElementModel, PointMasses, RigidLinks

# Nodes from which a mesh that was read is taken as fine enough: to halve it would take minutes and
# gigabytes.
LARGE = 10_000


def is_large(mesh: BuildingMesh, parts: int = 1) -> bool:
    """Whether a mesh that was read stays as it is, were every element in so many parts."""
    return parts * len(mesh.model.nodes) > LARGE


def split_mesh(mesh: BuildingMesh) -> BuildingMesh:
    """The mesh with new nodes in the middle of every edge and every quadrilateral.

    Struts stay whole: in two parts nothing would hold their middle. Nodes keep their numbers. A new
    one is held, or follows a rigid body, as all of those between which it lies do. What a slab
    carries all over is spread over the new nodes; other masses, and springs, stay where they are.
    """
    model, count = mesh.model, len(mesh.model.nodes)
    pairs = [np.sort(_edges(block), axis=2).reshape(-1, 2) for block in model.elements]
    edges, number = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    middles = np.split(count + number.ravel(), np.cumsum([len(pair) for pair in pairs])[:-1])
    centres = [block.nodes for block in model.elements if block.cell_type == "quad"]
    quads = np.concatenate([np.zeros((0, 4), dtype=np.int64), *centres])
    weights = vstack([eye_array(count), _mean_of(edges, count), _mean_of(quads, count)]).tocsr()
    split, centre = [], count + len(edges)  # node in the middle of the next quadrilateral
    for block, middle in zip(model.elements, middles, strict=True):
        split.append(_split(block, middle, centre))
        centre += len(block) if block.cell_type == "quad" else 0
    parents = [edges, quads]
    fixed = np.concatenate([model.fixed, *(model.fixed[parent].all(axis=1) for parent in parents)])
    at_base = np.isin(edges, mesh.base_nodes).all(axis=1)
    finer = replace(
        model,
        nodes=weights @ model.nodes,
        fixed=fixed,
        elements=tuple(split),
        links=_links(model.links, parents, count),
        names=None,
    )
    return replace(
        mesh,
        model=replace(finer, links=_with_edge_joints(finer, count), masses=_spread(model, finer)),
        base_nodes=np.concatenate([mesh.base_nodes, count + np.flatnonzero(at_base)]),
        parts=mesh.parts
        and tuple(p[_parents(b)] for p, b in zip(mesh.parts, model.elements, strict=True)),
        of_coarser=weights,
    )


def _edges(block: Elements) -> Integers:
    """Both ends of every edge that is divided, (n, e, 2)."""
    nodes = block.nodes
    if block.dimension() == 1:
        return nodes[~_struts(block), None]
    return np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2)


def _struts(block: Elements) -> Flags:
    """Which lines (n,) bear no bending moment at either end."""
    if not isinstance(block, Beams):
        return np.ones(len(block), dtype=np.bool_)
    none = np.zeros((len(block), 2 * DOF_PER_NODE), dtype=np.bool_)
    free = none if block.released is None else block.released
    return np.asarray(free[:, [4, 5, 10, 11]].all(axis=1))


def _parents(block: Elements) -> Integers:
    """Which element each part is of: one's parts beside each other, whole struts last."""
    if block.dimension() == 2:
        return np.repeat(np.arange(len(block)), 4)
    struts = _struts(block)
    return np.concatenate([np.repeat(np.flatnonzero(~struts), 2), np.flatnonzero(struts)])


def _mean_of(nodes: Integers, count: int) -> csr_array:
    """Weights (m, count) that take the mean of (m, k) nodes each."""
    rows = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    values = np.full(nodes.size, 1.0 / nodes.shape[1])
    return csr_array((values, (rows, nodes.ravel())), shape=(len(nodes), count))


def _split(block: Elements, middle: Integers, first_centre: int) -> Elements:
    """Parts in the order of `_parents`; `middle` are the new nodes on the edges, one by one."""
    corner, parents = block.nodes, _parents(block)
    taken = block.taken(parents)
    if block.dimension() == 1:
        halves = 2 * len(middle)
        start, end = corner[parents[:halves:2]].T
        parts = [np.column_stack(pair) for pair in ((start, middle), (middle, end))]
        nodes = np.concatenate([np.stack(parts, axis=1).reshape(-1, 2), corner[parents[halves:]]])
        if not isinstance(taken, Beams):
            return replace(taken, nodes=nodes)
        offset, released = taken.offset, taken.released
        if offset is not None:  # arms and pins are at the ends of the whole beams
            offset = offset.copy()
            of_halves = offset[:halves]
            of_halves[::2, 1] = of_halves[1::2, 0] = of_halves[::2].mean(axis=1)
        if released is not None:
            released = released.copy()
            released[:halves:2, DOF_PER_NODE:] = released[1:halves:2, :DOF_PER_NODE] = False
        return replace(taken, nodes=nodes, offset=offset, released=released)
    middle = middle.reshape(corner.shape)
    before, triangle = np.roll(middle, 1, axis=1), corner.shape[1] == 3
    inner = [middle] if triangle else []
    last = () if triangle else (first_centre + np.arange(len(block)),)
    parts = [
        np.column_stack([corner[:, k], middle[:, k], *last, before[:, k]])
        for k in range(corner.shape[1])
    ]
    return replace(taken, nodes=np.stack([*parts, *inner], axis=1).reshape(-1, corner.shape[1]))


def _spread(model: FiniteElementModel, finer: FiniteElementModel) -> PointMasses:
    """The masses, of which what all corners of a slab's element have is spread over its parts.

    What both ends of a beam in a slab have beside that, such as of a wall that is mass alone, is
    spread along it. Lumped masses of elements stay, and so do those of slabs without nodes inside.
    """
    mass, spread, inertia = np.zeros((3, len(finer.nodes), 3))
    np.add.at(mass, model.masses.node, model.masses.mass)
    np.add.at(inertia, model.masses.node, model.masses.inertia)
    pairs = [p for p in zip(model.elements, finer.elements, strict=True) if p[0].density.any()]
    met = np.zeros(len(finer.nodes))  # elements of slabs at each node
    for kind, least in (("slab", 4), ("beam", 2)):
        size = np.zeros(len(finer.nodes))  # m2 or m
        for block, _ in pairs:
            held = mass[block.nodes] > 1e-9 * mass.max(initial=0.0)  # more than rounding leaves
            on = (block.kind == kind) & held.any(axis=2).all(axis=1)
            share = on * block.measure(finer.nodes) / block.node_count()
            np.add.at(size, block.nodes, share[:, None])
            np.add.at(met, block.nodes, ((block.kind == "slab") & (kind == "slab"))[:, None])
        load = mass / np.where(size > 0.0, size, np.inf)[:, None]
        for block, parts in pairs:
            chosen = (block.kind == kind) & (met[block.nodes].max(axis=1) >= least)
            common = load[block.nodes].min(axis=1) * chosen[:, None]
            for at, each, of in ((mass, block, -common), (spread, parts, common[_parents(block)])):
                share = each.measure(finer.nodes) / each.node_count()
                np.add.at(at, each.nodes, (share[:, None] * of)[:, None])
    return PointMasses(np.arange(len(mass)), np.maximum(mass, 0.0) + spread, inertia)


def _with_edge_joints(model: FiniteElementModel, count: int) -> RigidLinks:
    """The links, and those of beams at edges of shells, which ended at the first `count` nodes."""
    links = model.links
    rigid = links.tied.all(axis=1)
    bound = {*links.master[rigid].tolist(), *links.slave[rigid].tolist()}
    joints = [j for j in edge_joints(model) if j.node < count and j.node not in bound]
    more = joint_links(model, tuple(joints))
    more = more.taken(~np.isin(more.slave, list(bound)))
    followed = np.zeros((len(model.nodes), DOF_PER_NODE), dtype=np.bool_)
    np.logical_or.at(followed, links.slave, links.tied)
    return links.joined(replace(more, tied=more.tied & ~followed[more.slave]))


def _links(links: RigidLinks, parents: list[Integers], count: int) -> RigidLinks:
    """The links, and those of new nodes all of whose parents belong to one rigid body."""
    bodies: dict[int, dict[int, Flags]] = {}
    for master, slave, tied in zip(
        links.master.tolist(), links.slave.tolist(), links.tied, strict=True
    ):
        bodies.setdefault(slave, {})[master] = tied
        bodies.setdefault(master, {}).setdefault(master, np.ones(DOF_PER_NODE, dtype=np.bool_))
    rows: list[tuple[int, int, Flags]] = []
    numbered = enumerate((member for group in parents for member in group.tolist()), count)
    for number, nodes in numbered if bodies else ():
        of_nodes = [bodies.get(node, {}) for node in nodes]
        for master in set(of_nodes[0]).intersection(*of_nodes[1:]):
            tied = np.logical_and.reduce([body[master] for body in of_nodes])
            rows.append((master, number, tied))
    if not rows:
        return links
    master, slave, tied = zip(*rows, strict=True)
    return links.joined(RigidLinks(np.array(master), np.array(slave), np.array(tied)))
