"""A user's own mesh as a building: groups of cells become walls, slabs, columns and beams."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Flags, Floats, Integers, Strings
from femupdate.building.connections import connected
from femupdate.building.entry import Complaint, unknown
from femupdate.building.masses import place_masses
from femupdate.building.mesh import BuildingMesh
from femupdate.building.mesh_check import check_connected, check_elements, merge_nodes
from femupdate.building.mesh_reader import RawMesh, read_mesh
from femupdate.building.mesh_spans import beam_arms, beam_releases, span_ends
from femupdate.building.own_mesh import MeshBuilding, Part
from femupdate.building.parameters import stiffness_factors
from femupdate.building.quantities import ALL
from femupdate.errors import BuildingError, ModelError
from femupdate.fe.element import Elements, area_vectors
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel
from femupdate.fe.registry import element_for
from femupdate.units import factor

_LEVEL = 1e-3  # m; nodes nearer than this to a floor's level are on it
_UPRIGHT = 0.9  # vertical component of the axis of what is a column, of the normal of a slab


@dataclass(frozen=True)
class _Block:
    """The cells that belong to one part and become elements of one kind."""

    part: int
    element: type[Elements]
    nodes: Integers
    group: Integers
    kind: Strings


def import_mesh(building: MeshBuilding) -> BuildingMesh:
    """Return the mesh of a building of kind "mesh".

    Raises:
        BuildingError: the file cannot be read, its groups do not fit the parts, an element or a
            connection is wrong, or there is no node where a floor or a sensor should be.
    """
    try:
        return _import(building)
    except Complaint as complaint:
        raise BuildingError(f"{complaint.key}: {complaint}") from None


def _import(building: MeshBuilding) -> BuildingMesh:
    raw = read_mesh(Path(building.mesh.file).expanduser(), building.mesh.tags)
    nodes = raw.nodes * factor(building.mesh.unit, "length") - [0.0, 0.0, building.mesh.base]
    raw = _merged(building, raw, nodes)
    blocks = list(_blocks(building, raw, nodes))
    used = np.unique(np.concatenate([block.nodes.ravel() for block in blocks]))
    by_type = {
        kind: np.concatenate([b.nodes for b in blocks if b.element.cell_type == kind])
        for kind in dict.fromkeys(block.element.cell_type for block in blocks)
    }
    check_elements(nodes, by_type, doubles_allowed=building.mesh.merge is not None)
    base = used[np.abs(nodes[used, 2]) < _LEVEL]
    if not len(base):
        text = f"no node lies at the base; the lowest is {nodes[used, 2].min():g} m above it"
        raise Complaint("mesh.base", f"{text}; correct the level of the base or the unit")
    check_connected(nodes, list(by_type.values()), base)
    model = _model(building, blocks, nodes[used], used)
    floors = _floor_nodes(building, model.nodes)
    masses = place_masses(building, model, [])
    on_base = np.searchsorted(used, base)
    diaphragms = list(_diaphragms(building, blocks, nodes, used))
    model = connected(model, on_base, building.supports, diaphragms)
    return BuildingMesh(
        model=replace(model, masses=masses),
        floors=building.floors,
        floor_nodes=floors,
        floor_level=building.floor_levels,
        base_nodes=on_base,
        direction="xy".index(building.sensors.direction),
        story_names=building.story_names,
        factors=stiffness_factors(building),
        ground_mass=0.0,
        parts=tuple(_owners(own) for own in _by_element(blocks).values()),
    )


def _by_element(blocks: Sequence[_Block]) -> dict[type[Elements], list[_Block]]:
    """The blocks of each kind of element, in the order of the model's elements."""
    kinds = dict.fromkeys(block.element for block in blocks)
    return {kind: [block for block in blocks if block.element is kind] for kind in kinds}


def _owners(blocks: Sequence[_Block]) -> Integers:
    """Part of every element of one kind."""
    return np.concatenate([np.full(len(block.nodes), block.part) for block in blocks])


def _merged(building: MeshBuilding, raw: RawMesh, nodes: Floats) -> RawMesh:
    if not building.mesh.merge:
        return raw
    number = merge_nodes(nodes, building.mesh.merge)
    cells = {kind: replace(cells, nodes=number[cells.nodes]) for kind, cells in raw.cells.items()}
    return replace(raw, cells=cells)


def _blocks(building: MeshBuilding, raw: RawMesh, nodes: Floats) -> Iterator[_Block]:
    """Yield the cells of all parts; every cell must belong to one, or be ignored."""
    taken = {kind: np.full(len(cells.nodes), -1) for kind, cells in raw.cells.items()}
    ignored = {
        kind: _chosen(raw, kind, building.mesh.ignore or (), "mesh.ignore") for kind in raw.cells
    }
    for number, part in enumerate(building.parts):
        key = f"parts[{number}]"
        found = False
        for kind in raw.cells:
            if (kind == "line") != (part.thickness is None):
                continue
            chosen = _chosen(raw, kind, part.group, f"{key}.group") & ~ignored[kind]
            _refuse_taken(raw, kind, taken[kind], chosen, key)
            taken[kind][chosen] = number
            if chosen.any():
                found = True
                yield _block(building, number, part, kind, raw.cells[kind].nodes[chosen], nodes)
        if not found:
            what = "surfaces" if part.thickness is not None else "lines"
            text = f"no {what} of the mesh belong to it (groups: {', '.join(raw.group_names)})"
            raise Complaint(f"{key}.group", f"{text}; correct the name or remove the part")
    for kind, owner in taken.items():
        _refuse_left(raw, kind, (owner < 0) & ~ignored[kind], nodes)


def _chosen(raw: RawMesh, kind: str, names: tuple[str, ...], key: str) -> Flags:
    cells = raw.cells[kind]
    if names == ALL:
        return np.ones(len(cells.nodes), dtype=np.bool_)
    chosen = np.zeros(len(cells.nodes), dtype=np.bool_)
    for name in names:
        if name not in raw.group_names:
            raise Complaint(key, unknown("group of the mesh", name, raw.group_names))
        chosen |= cells.groups.get(name, np.zeros(len(chosen), dtype=np.bool_))
    return chosen


def _refuse_taken(raw: RawMesh, kind: str, owner: Integers, chosen: Flags, key: str) -> None:
    double = np.flatnonzero(chosen & (owner >= 0))
    if len(double):
        text = f"{len(double)} {kind} cells belong to parts[{owner[double[0]]}] already"
        raise Complaint(f"{key}.group", f"{text}; let every cell belong to one part")


def _refuse_left(raw: RawMesh, kind: str, left: Flags, nodes: Floats) -> None:
    if left.any():
        first = int(left.argmax())
        own = [name for name, flags in raw.cells[kind].groups.items() if flags[first]]
        place = ", ".join(f"{v:.4g}" for v in nodes[raw.cells[kind].nodes[first]].mean(axis=0))
        said = f"group {own[-1]!r}" if own else "no group"
        raise Complaint(
            "parts",
            f"{int(left.sum())} {kind} cells belong to no part, such as the one at ({place}) m in "
            f"{said}; add a [[parts]] table, or name the group in mesh.ignore",
        )


def _block(
    building: MeshBuilding, number: int, part: Part, kind: str, cells: Integers, nodes: Floats
) -> _Block:
    middle = nodes[cells].mean(axis=1)[:, 2]
    if part.story is not None:
        group = np.full(len(cells), building.story_names.index(part.story))
    else:
        top = building.floor_levels
        group = np.searchsorted(top, middle - _LEVEL)
        if (group >= len(top)).any() or (middle < -_LEVEL).any():
            worst = middle[int(np.abs(middle - top[-1] / 2).argmax())]
            text = f"cells at {worst:g} m lie outside the stories (0 to {top[-1]:g} m)"
            raise Complaint("stories", f"{text}; correct the heights, mesh.base or mesh.unit")
    names = np.full(len(cells), part.kind or "", dtype="<U24")
    if part.kind is None:
        names = _kinds(nodes[cells])
    element = _element_of(part, kind, f"parts[{number}]")
    return _Block(number, element, cells, group.astype(np.int64), names)


def _element_of(part: Part, cell_type: str, key: str) -> type[Elements]:
    try:
        element = element_for(cell_type, part.element)
    except ModelError as error:
        raise Complaint(f"{key}.element", str(error)) from None
    known = {one.name for one in fields(element)}
    if (part.has_arms and "offset" not in known) or (part.hinges and "released" not in known):
        text = f"a {element.name} has no eccentricity, rigid ends or hinges; remove them"
        raise Complaint(f"{key}.element", text)
    return element


def _kinds(points: Floats) -> Strings:
    """What cells are by their direction."""
    if points.shape[1] == 2:
        axis = points[:, 1] - points[:, 0]
        steep = np.abs(axis[:, 2]) > _UPRIGHT * np.linalg.norm(axis, axis=1)
        return np.where(steep, "column", "beam").astype("<U24")
    normal = area_vectors(points)
    level = np.abs(normal[:, 2]) > _UPRIGHT * np.linalg.norm(normal, axis=1)
    return np.where(level, "slab", "wall").astype("<U24")


def _model(
    building: MeshBuilding, blocks: Sequence[_Block], points: Floats, used: Integers
) -> FiniteElementModel:
    kinds = _by_element(blocks)
    return FiniteElementModel(
        nodes=points,
        fixed=np.zeros((len(points), DOF_PER_NODE), dtype=np.bool_),
        groups=len(building.stories),
        elements=tuple(_elements(building, kind, own, points, used) for kind, own in kinds.items()),
    )


def _elements(
    building: MeshBuilding,
    kind: type[Elements],
    blocks: Sequence[_Block],
    points: Floats,
    used: Integers,
) -> Elements:
    """The elements of one kind; of what the parts say each kind takes what it has fields for."""
    nodes = np.searchsorted(used, np.concatenate([block.nodes for block in blocks]))
    counts = [len(block.nodes) for block in blocks]
    known: dict[str, Any] = {
        "nodes": nodes,
        "group": np.concatenate([block.group for block in blocks]),
        "kind": np.concatenate([block.kind for block in blocks]),
    }
    constants = [_constants(building, building.parts[block.part]) for block in blocks]
    for name in constants[0]:
        known[name] = np.repeat(np.array([own[name] for own in constants]), counts, axis=0)
    if kind.dimension() == 1:
        known["up"] = _up(building, blocks, points[nodes])
        known["offset"], known["released"] = _ends(building, blocks, points, nodes)
    fitting = {one.name for one in fields(kind)}
    return kind(**{name: values for name, values in known.items() if name in fitting})


def _constants(building: MeshBuilding, part: Part) -> dict[str, Any]:
    """Material, and thickness or figures of the section, of a part."""
    section = building.sections[part.section] if part.section else None
    material = building.material(part.material or (section.material if section else None))
    own = {name: getattr(material, name) for name in ("youngs_modulus", "poisson_ratio", "density")}
    if section is None:
        return {**own, "thickness": part.thickness}
    figures = section.figures()
    names = [one.name for one in fields(figures) if one.name != "extent"]
    return {**own, **{name: getattr(figures, name) for name in names}, "size": figures.size}


def _up(building: MeshBuilding, blocks: Sequence[_Block], ends: Floats) -> Floats:
    """Direction (n, 3) of the depth of lines (n, 2, 3): along y in upright ones, else upwards."""
    axis = ends[:, 1] - ends[:, 0]
    steep = np.abs(axis[:, 2]) > _UPRIGHT * np.linalg.norm(axis, axis=1)
    up = np.where(steep[:, None], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    owner = _owners(blocks)
    for number in np.unique(owner):
        if (own := building.parts[number].up) is not None:
            up[owner == number] = own
    return up


def _ends(
    building: MeshBuilding, blocks: Sequence[_Block], points: Floats, lines: Integers
) -> tuple[Floats | None, Flags | None]:
    """Arms (n, 2, 3) and releases (n, 12) of all beams, None where no part has any."""
    parts = [building.parts[block.part] for block in blocks]
    offset = np.zeros((len(lines), 2, 3)) if any(part.has_arms for part in parts) else None
    released = np.zeros((len(lines), 12), np.bool_) if any(part.hinges for part in parts) else None
    start = 0
    for block, part in zip(blocks, parts, strict=True):
        own = slice(start, start + len(block.nodes))
        start = own.stop
        if not part.has_arms and part.hinges is None:
            continue
        others = np.delete(lines, np.arange(own.start, own.stop), axis=0)
        spans = span_ends(points, lines[own], others.ravel())
        if offset is not None:
            offset[own] = beam_arms(part, points, lines[own], spans, f"parts[{block.part}]")
        if released is not None:
            released[own] = beam_releases(part, spans)
    return offset, released


def _floor_nodes(building: MeshBuilding, points: Floats) -> dict[str, Integers]:
    found = {}
    for floor, level in zip(building.floors, building.floor_levels, strict=True):
        on_level = np.flatnonzero(np.abs(points[:, 2] - level) < _LEVEL)
        if not len(on_level):
            nearest = points[int(np.abs(points[:, 2] - level).argmin()), 2]
            text = f"no node of the mesh lies at the level of {floor}, {level:g} m (the nearest is"
            raise Complaint("stories", f"{text} {nearest:g} m); correct the heights or mesh.base")
        _, sensors = building.sensors.of(floor)
        away = np.linalg.norm(points[on_level, None, :2] - np.array(sensors), axis=2)
        found[floor] = on_level[away.argmin(axis=0)]
    return found


def _diaphragms(
    building: MeshBuilding, blocks: Sequence[_Block], nodes: Floats, used: Integers
) -> Iterator[Integers]:
    for block in blocks:
        if building.parts[block.part].diaphragm != "rigid":
            continue
        own = np.unique(block.nodes)
        for level in building.floor_levels:
            on_floor = own[np.abs(nodes[own, 2] - level) < _LEVEL]
            if len(on_floor):
                yield np.searchsorted(used, on_floor)
