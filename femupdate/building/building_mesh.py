"""A building as a finite-element model, and what the model's nodes mean.

Beside elements diaphragms, a sprung footing and joints join its nodes.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from femupdate.arrays import Floats, Integers
from femupdate.building.blocks import DeadWall
from femupdate.building.common import BASE
from femupdate.building.entry import ALL, Complaint
from femupdate.building.kinds import CLOSEST_LINES, FrameBuilding, MeshBuilding
from femupdate.building.lattice import ExtraLines
from femupdate.building.members import SPRING_KEYS, SixSprings, Supports
from femupdate.building.mesh_check import nodes_at, piece_of
from femupdate.building.references import intersections, resolve
from femupdate.fe.joints import edge_joints, joint_links
from femupdate.fe.model import (
    CONSTANT,
    DOF_PER_NODE,
    FiniteElementModel,
    PointMasses,
    RigidLinks,
    Springs,
)

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


Massive = FrameBuilding | MeshBuilding
_ROUNDING = 1e-9  # of a floor's mass


def self_mass(model: FiniteElementModel, dead: Iterable[DeadWall]) -> Floats:
    """Return the mass of what each story owns, (groups,) kg.

    Story i owns the columns and walls below floor i+1, those without stiffness included, and that
    floor's slab and beams; all are taken between centre lines, without deducting their overlaps.
    """
    total = np.zeros(model.groups)
    for part in model.elements:
        np.add.at(total, part.group, part.mass(model.nodes))
    for wall in dead:
        total[wall.group] += wall.mass
    return total


def place_masses(
    building: Massive, model: FiniteElementModel, dead: Sequence[DeadWall]
) -> PointMasses:
    """Return the masses at nodes: the rest of the floor masses, and the walls without stiffness.

    Half of such a wall goes to the nodes along it on the floor above and half to those on the
    floor below; on the ground the lower half is left out. Before that its whole mass counts as
    self weight of the floor above, like that of the walls with stiffness.
    """
    weights, at_node = self_mass(model, dead), np.zeros(len(model.nodes))
    for number, mass in enumerate(building.floor_mass):
        key = f"floor_mass[{number}]"
        for floor in resolve(mass.floors, building.floors, "floor", f"{key}.floors"):
            group = building.floors.index(floor)
            rest = mass.total - weights[group]
            if rest < -_ROUNDING * mass.total:
                text = (
                    f"{floor} weighs {weights[group] / 1e3:.4g} t by itself (its slab and beams, "
                    "and the columns and walls below it), more than the "
                    f"{mass.total / 1e3:.4g} t in all; raise the total, or correct the member that "
                    "is too heavy"
                )
                raise Complaint(f"{key}.total", text)
            area = np.zeros(len(model.nodes))  # of slab that each node carries
            for part in model.elements:
                slab = part.taken(np.flatnonzero((part.kind == "slab") & (part.group == group)))
                share = slab.measure(model.nodes) / slab.node_count()
                np.add.at(area, slab.nodes, share[:, None])
            if rest > _ROUNDING * mass.total and not area.any():
                text = f"{floor} has no slab to carry its mass; add one, or remove the floor mass"
                raise Complaint(f"{key}.floors", text)
            at_node += max(rest, 0.0) * area / (area.sum() or 1.0)
    for wall in dead:
        np.add.at(at_node, wall.above, wall.share)
        if len(wall.below):
            np.add.at(at_node, wall.below, wall.share)
    node = np.flatnonzero(at_node)
    return PointMasses(node=node, mass=at_node[node], inertia=np.zeros((len(node), 3)))


def _refuse_soft_springs(
    model: FiniteElementModel, masses: PointMasses, base: Integers, supports: Supports
) -> None:
    """Raise Complaint for springs at the base on which the whole building would hardly stand."""
    middle = model.nodes[base].mean(axis=0)
    mass = np.concatenate([masses.mass[:, 0], *(part.mass(model.nodes) for part in model.elements)])
    points = [model.nodes[part.nodes].mean(axis=1) for part in model.elements]
    arm = np.concatenate([model.nodes[masses.node], *points]) - middle
    turned = mass @ (np.sum(arm**2, axis=1, keepdims=True) - arm**2)
    inertia = np.concatenate([np.full(3, mass.sum()), turned])
    named = [f"supports.{key}" for key in SPRING_KEYS]
    rates = list(zip(named, supports.springs, inertia, strict=True))
    at_base = np.isin(model.springs.nodes[:, 0], base)
    for way in range(3):  # of springs under single columns, together
        if not model.fixed[base, way].any():
            total = model.springs.stiffness[at_base & (model.springs.direction == way)].sum()
            rates.append((f"springs[0].{SPRING_KEYS[way]}", total, inertia[way]))
    for key, spring, moved in rates:
        # Isolated buildings and tall towers move at .1 Hz and more.
        if spring and (hz := np.sqrt(spring / moved) / (2.0 * np.pi)) < 0.05:
            text = f"the whole building would move at {hz:.1g} Hz on its springs"
            raise Complaint(key, f"{text}, and no foundation is that soft; is the unit wrong?")


def sprung(
    building: Massive, model: FiniteElementModel, base: Integers
) -> Iterator[tuple[Integers, SixSprings]]:
    """The nodes of every group of springs to the ground."""
    ends = np.unique(np.concatenate([b.nodes[b.kind == "column"].ravel() for b in model.elements]))
    feet = np.intersect1d(base, ends)
    for number, group in enumerate(building.springs):
        key, nodes = f"springs[{number}]", feet
        if group.points:
            nodes = nodes_at(model, group.points, f"{key}.points")
        elif group.at != ALL and isinstance(building, FrameBuilding):
            grid, found = building.grid, []
            for m, point in enumerate(intersections(grid, group.at, f"{key}.at")):
                away = np.abs(model.nodes[feet, :2] - (grid.x[point.x], grid.y[point.y]))
                here = feet[(away < CLOSEST_LINES).all(axis=1)]
                if not len(here):
                    text = f"no column stands on the base at {group.at[m]}; name another or remove"
                    raise Complaint(f"{key}.at[{m}]", f"{text} it")
                found.append(int(here[0]))
            nodes = np.array(found)
        elif not len(feet):
            raise Complaint(f"{key}.at", "no column stands on the base; give points instead")
        yield nodes, group


@dataclass(frozen=True, kw_only=True)
class BuildingMesh:
    """A meshed building."""

    model: FiniteElementModel  # the finite-element model; its groups are the stories
    floors: tuple[str, ...]  # names of the floors, bottom to top ("2F" ... "RF").
    floor_nodes: Mapping[str, Integers]  # node indices of each floor's sensor points
    floor_level: Floats  # (floors,) height above the base, m
    foot_level: Floats  # (stories,) of the floors on which the stories stand, m
    base_nodes: Integers  # (n,) indices of the nodes at the base
    direction: int  # 0 where motion is measured along x, 1 along y
    story_names: tuple[str, ...]  # names of the stories, bottom to top
    # of a mesh that was read: which of the file's `parts` each element belongs to, one array a
    # block of the model's elements
    parts: tuple[Integers, ...] | None = None
    walls: tuple[str, ...] = ()  # of a deck: names of its walls, whose numbers `parts` holds
    notes: tuple[str, ...] = ()  # what was made of entries or cards, a sentence each
    # of a mesh that was split: weights (nodes, n) of the n nodes that it had before
    of_coarser: csr_array | None = None


def described(
    building: Massive,
    model: FiniteElementModel,
    base: Integers,
    floor_nodes: Mapping[str, Integers],
    *,
    parts: tuple[Integers, ...] | None,
    walls: tuple[str, ...] = (),
    notes: tuple[str, ...],
) -> BuildingMesh:
    """The mesh of a whole model whose groups are stories; arguments as of a `BuildingMesh`."""
    return BuildingMesh(
        model=model,
        floors=building.floors,
        floor_nodes=floor_nodes,
        floor_level=building.floor_levels,
        foot_level=np.append(0.0, building.floor_levels)[np.array(building.below) + 1],
        base_nodes=base,
        direction="xy".index(building.sensors.direction),
        story_names=building.story_names,
        parts=parts,
        walls=walls,
        notes=(*notes, *story_notes(building)),
    )


def finished(
    building: Massive,
    model: FiniteElementModel,
    base: Integers,
    floor_nodes: Mapping[str, Integers],
    *,
    diaphragms: Iterable[Integers] = (),
    dead: Sequence[DeadWall] = (),
    parts: tuple[Integers, ...] | None = None,
    notes: tuple[str, ...] = (),
) -> BuildingMesh:
    """Return the mesh of a building with its masses, supports and links.

    Args:
        model: elements only, whose groups are stories.
        base, floor_nodes, parts, notes: as of a `BuildingMesh`.
        diaphragms: node indices of each slab that is rigid in plan.
        dead: walls without stiffness, on the model's nodes.
    """
    masses = place_masses(building, model, dead)
    held = connected(model, base, building.supports, sprung(building, model, base), diaphragms)
    _refuse_soft_springs(held, masses, base, building.supports)
    whole = replace(held, masses=masses)
    return described(building, whole, base, floor_nodes, parts=parts, notes=notes)


def story_notes(building: Massive) -> Iterator[str]:
    """Yield what stories that stand beside each other mean."""
    if not building.is_chain:
        places = (BASE, *building.floors)
        beside: dict[str, list[str]] = {}
        for name, foot in zip(building.story_names, building.below, strict=True):
            beside.setdefault(places[foot + 1], []).append(name)
        listed = "; ".join(
            f"{' and '.join(names)} on {foot}" for foot, names in beside.items() if len(names) > 1
        )
        tops = map("{} over {}".format, building.floors, building.story_names)
        yield f"Floors: {', '.join(tops)}."
        yield (
            f"Stories stand beside each other: {listed or 'none'}. A story's shear is the inertia "
            "of what stands on it; what neighbours pass on to each other is in the forces of "
            "members alone (predict --member)."
        )
