"""A user's own mesh as a building: groups of cells become walls, slabs, columns and beams.

The file is read through meshio: nodes, cells by type, and the groups that cells belong to.
"""

import contextlib
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.blocks import ElementBlock, by_element, joined
from femupdate.building.building_mesh import BuildingMesh, described, finished, sprung, with_springs
from femupdate.building.entry import ALL, Complaint, complaining, unknown
from femupdate.building.kinds import MeshBuilding, Part
from femupdate.building.mesh_check import (
    LEVEL,
    UPRIGHT,
    cell_kinds,
    check_connected,
    check_elements,
    merge_nodes,
    nodes_at,
    piece_of,
    place,
    stories_of_nodes,
)
from femupdate.building.model_files import building_model
from femupdate.errors import StructureError
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel
from femupdate.fe.registry import cell_types, element_for
from femupdate.storage import LARGEST_BYTES, refuse_endless
from femupdate.units import factor

_MEND = "write it as gmsh 2.2 or 4.1 (.msh), Abaqus (.inp), MED (.med) or VTU (.vtu)"
_POINTS = ("vertex",)  # they carry no stiffness and are left out


@dataclass(frozen=True)
class Cells:
    """All cells of one type."""

    nodes: Integers  # (n, 2), (n, 3) or (n, 4) node indices
    groups: Mapping[str, Flags]  # (n,) flags for every group's name


@dataclass(frozen=True)
class RawMesh:
    """What a mesh file holds, in its own unit."""

    nodes: Floats  # (N, 3) coordinates
    cells: Mapping[str, Cells]  # by type: "line", "triangle", "quad"

    @property
    def group_names(self) -> tuple[str, ...]:
        """Names of all groups that have a cell."""
        names = {
            name
            for cells in self.cells.values()
            for name, flags in cells.groups.items()
            if flags.any()
        }
        return tuple(sorted(names))


def read_mesh(path: Path, tags: str | None) -> RawMesh:
    """Read a mesh file: gmsh, Abaqus, MED, VTU or another format that meshio knows.

    Args:
        tags: cell data that holds the groups' numbers, if any.
    """
    mesh = _read(path)
    _refuse_other_cells(mesh)
    _check_points(mesh)
    if tags is not None and tags not in mesh.cell_data:
        known = ", ".join(sorted(mesh.cell_data)) or "none"
        raise Complaint("mesh.tags", f"the mesh has no cell data {tags!r} (it has: {known})")
    nodes = np.zeros((len(mesh.points), 3))
    nodes[:, : mesh.points.shape[1]] = mesh.points
    try:
        cells = {kind: _cells(mesh, kind, count, tags) for kind, count in cell_types().items()}
    except (ValueError, IndexError, KeyError, TypeError, OverflowError) as error:
        raise Complaint(
            "mesh.file", f"its groups do not go with its cells ({error}); {_MEND}"
        ) from None
    return RawMesh(nodes, {kind: block for kind, block in cells.items() if len(block.nodes)})


def _read(path: Path) -> Any:
    import meshio

    # Unlike Path.is_file, this says no where a name is too long or a folder closed.
    if not os.path.isfile(path):
        raise Complaint("mesh.file", f"there is no file {path}; correct the path")
    size = path.stat().st_size
    if size > LARGEST_BYTES:  # it would fill the memory
        raise Complaint(
            "mesh.file",
            f"{path.name} holds {size / 1e6:.0f} MB, which no building's mesh needs; coarsen it",
        )
    try:
        # meshio prints what it thinks of a file, and exits where it cannot read one.
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if path.suffix == ".med":
                refuse_endless(path)
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # its readers raise whatever a broken file causes
        reason = str(error) if str(error) not in ("", "1") else "its content is not as its ending"
        raise Complaint("mesh.file", f"{path.name} cannot be read ({reason}); {_MEND}") from None


def _check_points(mesh: Any) -> None:
    """Refuse nodes that are no points in space, and cells of nodes that there are not."""
    points = np.asarray(mesh.points)
    if points.ndim != 2 or not 0 < points.shape[1] <= 3 or points.dtype.kind not in "fiu":
        per = points.shape[1] if points.ndim == 2 else "no"
        raise Complaint(
            "mesh.file",
            f"its nodes have {per} coordinates each (is the comma the decimal sign?); {_MEND}",
        )
    if not np.isfinite(points).all():
        raise Complaint("mesh.file", f"a coordinate of a node is not a number; {_MEND}")
    # Nobody builds a thousand kilometres, in mm.
    if points.size and np.abs(points).max() > 1e9:
        text = f"a node lies at {np.abs(points).max():.3g}, which no building reaches; {_MEND}"
        raise Complaint("mesh.file", text)
    for block in mesh.cells:
        data = np.asarray(block.data)
        known = data.dtype.kind in "iu" and data.ndim == 2
        if not known or (data.size and not (data.min() >= 0 and data.max() < len(points))):
            raise Complaint(
                "mesh.file", f"cells of type {block.type!r} name nodes that it has not; {_MEND}"
            )


def _refuse_other_cells(mesh: Any) -> None:
    for block in mesh.cells:
        if block.type in cell_types() or block.type in _POINTS:
            continue
        count = sum(len(b.data) for b in mesh.cells if b.type == block.type)
        plain = next((kind for kind in cell_types() if block.type.startswith(kind)), None)
        mend = (
            f'write the mesh with first-order elements ("{plain}")'
            if plain
            else "leave them out: walls, slabs, beams and columns are surfaces and lines"
        )
        text = f"it holds {count} cells of type {block.type!r}, which have no element here"
        raise Complaint("mesh.file", f"{text}; {mend}")


def _cells(mesh: Any, kind: str, corners: int, tags: str | None) -> Cells:
    """Join the blocks of one type, whose cells have so many corners."""
    blocks = [number for number, block in enumerate(mesh.cells) if block.type == kind]
    if not blocks:
        return Cells(np.zeros((0, corners), dtype=np.int64), {})
    nodes = np.concatenate([mesh.cells[number].data for number in blocks]).astype(np.int64)
    names: dict[str, list[Flags]] = {}
    for at, number in enumerate(blocks):
        count = len(mesh.cells[number].data)
        for name, flags in _groups(mesh, number, count, tags):
            empty = [np.zeros(len(mesh.cells[b].data), dtype=np.bool_) for b in blocks]
            names.setdefault(name, empty)[at] |= flags
    return Cells(nodes, {name: np.concatenate(parts) for name, parts in names.items()})


def _groups(mesh: Any, block: int, count: int, tags: str | None) -> Iterable[tuple[str, Flags]]:
    """Yield the groups of one block with the flags of its cells."""
    for key in ("gmsh:physical", "cell_tags", tags):
        if key is None or key not in mesh.cell_data:
            continue
        values = np.asarray(mesh.cell_data[key][block]).ravel()
        for value in np.unique(values):
            names = [f"{float(value):g}"]
            if key == "cell_tags":  # MED: a family may belong to several groups
                names += getattr(mesh, "cell_tags", {}).get(int(value), [])
            elif key == "gmsh:physical":
                names += [n for n, data in mesh.field_data.items() if int(data[0]) == int(value)]
            for name in names:
                yield name, values == value
    for name, sets in mesh.cell_sets.items():
        if name.startswith("gmsh:") or sets[block] is None:
            continue
        flags = np.zeros(count, dtype=np.bool_)
        flags[np.asarray(sets[block], dtype=np.int64)] = True
        yield name, flags


def span_ends(nodes: Floats, lines: Integers, others: Integers) -> tuple[Flags, Flags]:
    """Whether a span starts, and whether it ends, at the nodes (n, 2) of each line element.

    A span runs straight on until it meets another line element, forks or ends. It starts at the
    lower coordinate along the axis (x, y or z) along which it runs most.

    Args:
        lines: (n, 2) node indices.
        others: nodes of other line elements.
    """
    broken = np.bincount(lines.ravel(), minlength=len(nodes)) != 2  # nodes that spans do not pass
    broken[others] = True
    axis = nodes[lines[:, 1]] - nodes[lines[:, 0]]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    # Unit vectors away from a node add up to nothing where the two are one line.
    away = np.zeros((len(nodes), 3))
    np.add.at(away, lines[:, 0], axis)
    np.add.at(away, lines[:, 1], -axis)
    # One span turns by an angle of at most this cosine.
    broken |= np.einsum("nd,nd->n", away, away) > 2.0 - 2.0 * 0.985
    elements = np.repeat(np.arange(len(lines)), 2)
    passing = ~broken[lines.ravel()]
    shape = (len(lines), len(nodes))
    through = coo_array(
        (np.ones(int(passing.sum())), (elements[passing], lines.ravel()[passing])), shape=shape
    ).tocsr()
    _, span = connected_components(through @ through.T, directed=False)
    at_end = broken[lines]
    starts, ends = np.zeros_like(at_end), np.zeros_like(at_end)
    element, side = np.nonzero(at_end)
    order = np.argsort(span[element], kind="stable")  # the two ends of a span, one after the other
    first, second = element[order].reshape(-1, 2).T, side[order].reshape(-1, 2).T
    start, end = (nodes[lines[first[k], second[k]]] for k in range(2))
    along = np.abs(end - start).argmax(axis=1)
    rows = np.arange(len(along))
    swapped = (end[rows, along] < start[rows, along]).astype(np.int64)
    starts[first[swapped, rows], second[swapped, rows]] = True
    ends[first[1 - swapped, rows], second[1 - swapped, rows]] = True
    return starts, ends


def beam_arms(
    part: Part, nodes: Floats, lines: Integers, spans: tuple[Flags, Flags], key: str
) -> Floats:
    """Rigid arms from the nodes to the axes of a part's beams, (n, 2, 3) m."""
    arms = np.zeros((len(lines), 2, 3))
    arms += part.eccentricity or (0.0, 0.0, 0.0)
    if part.rigid_ends is None:
        return arms
    axis = nodes[lines[:, 1]] - nodes[lines[:, 0]]
    length = np.linalg.norm(axis, axis=1)
    first, last = part.rigid_ends
    rigid = first * spans[0] + last * spans[1]
    # A beam between rigid ends is longer than a millimetre.
    short = np.flatnonzero(rigid.sum(axis=1) > length - 1e-3)
    if len(short):
        where = place(nodes[lines[short[0]]].mean(axis=0))
        text = f"they leave nothing of the element at {where}, {length[short[0]]:.4g} m long"
        raise Complaint(f"{key}.rigid_ends", f"{text}; shorten them or make that element longer")
    inwards = np.stack([axis, -axis], axis=1) / length[:, None, None]
    return arms + rigid[:, :, None] * inwards


def beam_releases(part: Part, spans: tuple[Flags, Flags]) -> Flags:
    """Where the beams of a part pass no bending moment on, (n, 12)."""
    start, end = spans
    hinged = start & (part.hinges in ("start", "both")) | end & (part.hinges in ("end", "both"))
    released = np.zeros((len(hinged), 12), dtype=np.bool_)
    released[:, [4, 5]] = hinged[:, :1]
    released[:, [10, 11]] = hinged[:, 1:]
    return released


@complaining()
def import_mesh(building: MeshBuilding) -> BuildingMesh:
    """Return the mesh of a building of kind "mesh".

    Raises:
        BuildingError: the file cannot be read, its groups do not fit the parts, an element or a
            connection is wrong, or there is no node where a floor or a sensor should be.
    """
    if building.from_program:
        read = building_model(building)
        model = read.model
        for at, springs in sprung(building, model, read.held):
            model = with_springs(model, at, springs)
        where = (building, model, read.held, _floor_nodes(building, model))
        return described(*where, parts=read.wall_of, walls=read.walls, notes=read.notes)
    raw = read_mesh(Path(building.mesh.file).expanduser(), building.mesh.tags)
    nodes = raw.nodes * factor(building.mesh.unit, "length") - [0.0, 0.0, building.mesh.base]
    if building.mesh.merge:
        number = merge_nodes(nodes, building.mesh.merge)
        merged = {k: replace(cells, nodes=number[cells.nodes]) for k, cells in raw.cells.items()}
        raw = replace(raw, cells=merged)
    blocks = list(_blocks(building, raw, nodes))
    used = np.unique(np.concatenate([block.nodes.ravel() for block in blocks]))
    by_type = {
        kind: np.concatenate([b.nodes for b in blocks if b.element.cell_type == kind])
        for kind in dict.fromkeys(block.element.cell_type for block in blocks)
    }
    check_elements(nodes, by_type, doubles_allowed=building.mesh.merge is not None)
    base = used[np.abs(nodes[used, 2]) < LEVEL]
    if not len(base):
        text = f"no node lies at the base; the lowest is {nodes[used, 2].min():g} m above it"
        raise Complaint("mesh.base", f"{text}; correct the level of the base or the unit")
    check_connected(nodes, list(by_type.values()), base)
    blocks = list(_with_ends(building, blocks, nodes))
    model = FiniteElementModel(
        nodes=nodes[used],
        fixed=np.zeros((len(used), DOF_PER_NODE), dtype=np.bool_),
        groups=len(building.stories),
        elements=joined(blocks, used),
    )
    return finished(
        building,
        model,
        np.searchsorted(used, base),
        _floor_nodes(building, model),
        diaphragms=list(_diaphragms(building, blocks, nodes, used)),
        parts=tuple(
            np.concatenate([np.full(len(block.nodes), block.part) for block in alike])
            for alike in by_element(blocks).values()
        ),
    )


def _blocks(building: MeshBuilding, raw: RawMesh, nodes: Floats) -> Iterator[ElementBlock]:
    """Yield the cells of all parts; every cell must belong to one, or be ignored."""
    taken = {kind: np.full(len(cells.nodes), -1) for kind, cells in raw.cells.items()}
    ignored = {
        kind: _chosen(raw, kind, building.mesh.ignore or (), "mesh.ignore") for kind in raw.cells
    }
    for number, part in enumerate(building.parts):
        key = f"parts[{number}]"
        some = False
        for kind in raw.cells:
            if (kind == "line") != (part.thickness is None):
                continue
            chosen = _chosen(raw, kind, part.group, f"{key}.group") & ~ignored[kind]
            double = np.flatnonzero(chosen & (taken[kind] >= 0))
            if len(double):
                earlier = f"parts[{taken[kind][double[0]]}]"
                text = f"{len(double)} {kind} cells belong to {earlier} already"
                raise Complaint(f"{key}.group", f"{text}; let every cell belong to one part")
            taken[kind][chosen] = number
            if chosen.any():
                some = True
                yield _block(building, number, part, kind, raw.cells[kind].nodes[chosen], nodes)
        if not some:
            what = "surfaces" if part.thickness is not None else "lines"
            text = f"no {what} of the mesh belong to it (groups: {', '.join(raw.group_names)})"
            raise Complaint(f"{key}.group", f"{text}; correct the name or remove the part")
    for kind, owner in taken.items():
        left = (owner < 0) & ~ignored[kind]
        if left.any():
            first = int(left.argmax())
            groups = [name for name, flags in raw.cells[kind].groups.items() if flags[first]]
            where = place(nodes[raw.cells[kind].nodes[first]].mean(axis=0))
            said = f"group {groups[-1]!r}" if groups else "no group"
            raise Complaint(
                "parts",
                f"{int(left.sum())} {kind} cells belong to no part, such as the one at {where} in "
                f"{said}; add a [[parts]] table, or name the group in mesh.ignore",
            )


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


def _block(
    building: MeshBuilding, number: int, part: Part, kind: str, cells: Integers, nodes: Floats
) -> ElementBlock:
    middle = nodes[cells].mean(axis=1)
    if part.story is not None:
        group = np.full(len(cells), building.story_names.index(part.story))
    else:
        group = building.stories_at(middle)
        outside = np.flatnonzero((group < 0) | (middle[:, 2] < -LEVEL))
        if len(outside):
            where, top = place(middle[outside[0]]), building.floor_levels.max()
            text = f"cells at {where} lie outside the stories (0 to {top:g} m)"
            raise Complaint("stories", f"{text}; correct the heights, mesh.base or mesh.unit")
    section = building.sections[part.section] if part.section is not None else None
    material = part.material or (section.material if section is not None else None)
    key, up = f"parts[{number}]", None
    try:
        element = element_for(kind, part.element)
    except StructureError as error:
        raise Complaint(f"{key}.element", str(error)) from None
    known = {field.name for field in fields(element)}
    if (part.has_arms and "offset" not in known) or (part.hinges and "released" not in known):
        text = f"a {element.name} has no eccentricity, rigid ends or hinges; remove them"
        raise Complaint(f"{key}.element", text)
    if section is not None:  # its depth: along y in upright lines, else upwards
        axis = nodes[cells[:, 1]] - nodes[cells[:, 0]]
        steep = np.abs(axis[:, 2]) > UPRIGHT * np.linalg.norm(axis, axis=1)
        up = np.where(steep[:, None], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
        up = up if part.up is None else np.tile(part.up, (len(cells), 1))
    return ElementBlock(
        key=key,
        part=number,
        element=element,
        nodes=cells,
        group=group.astype(np.int64),
        kind=part.kind if part.kind is not None else cell_kinds(nodes[cells]),
        material=building.material(material),
        thickness=part.thickness,
        section=None if section is None else section.figures(),
        up=up,
    )


def _with_ends(
    building: MeshBuilding, blocks: Sequence[ElementBlock], nodes: Floats
) -> Iterator[ElementBlock]:
    """Yield the blocks with the arms and hinges that their parts have at the ends of spans."""
    lines = [block for block in blocks if block.section is not None]
    for block in blocks:
        part = building.parts[block.part]
        if part.has_arms or part.hinges is not None:
            others = [line.nodes.ravel() for line in lines if line is not block]
            meeting = np.concatenate([np.zeros(0, dtype=np.int64), *others])
            spans = span_ends(nodes, block.nodes, meeting)
            arms = beam_arms(part, nodes, block.nodes, spans, block.key) if part.has_arms else None
            hinges = beam_releases(part, spans) if part.hinges is not None else None
            block = replace(block, offset=arms, released=hinges)
        yield block


def _floor_nodes(building: MeshBuilding, model: FiniteElementModel) -> dict[str, Integers]:
    nearest_nodes, points = {}, model.nodes
    owner = stories_of_nodes(model, building.floor_levels)
    for floor, level in zip(building.floors, building.floor_levels, strict=True):
        if floor in building.sensors.at:
            at = building.sensors.at[floor]
            nearest_nodes[floor] = nodes_at(model, at, f"sensors.at.{floor}")
            continue
        there = building.is_chain | (owner == building.floors.index(floor))
        on_level = np.flatnonzero((np.abs(points[:, 2] - level) < LEVEL) & there)
        if not len(on_level):
            nearest = points[int(np.abs(points[:, 2] - level).argmin()), 2]
            text = f"no node of the mesh lies at the level of {floor}, {level:g} m (the nearest is"
            text += f" {nearest:g} m); correct the heights or mesh.base"
            if abs(nearest - level) < LEVEL:
                text = f"other stories have all nodes at {floor}, {level:g} m; give them x and y"
            raise Complaint("stories", text)
        _, sensors = building.sensors.of(floor)
        away = np.linalg.norm(points[on_level, None, :2] - np.array(sensors), axis=2)
        nearest_nodes[floor] = on_level[away.argmin(axis=0)]
    return nearest_nodes


def _diaphragms(
    building: MeshBuilding, blocks: Sequence[ElementBlock], nodes: Floats, used: Integers
) -> Iterator[Integers]:
    for block in blocks:
        if building.parts[block.part].diaphragm != "rigid":
            continue
        sides = np.stack([block.nodes, np.roll(block.nodes, 1, axis=1)], axis=2).reshape(-1, 2)
        for level in np.unique(building.floor_levels):
            on_floor = sides[(np.abs(nodes[sides, 2] - level) < LEVEL).all(axis=1)]
            piece = piece_of(len(nodes), on_floor)  # what does not touch is another diaphragm
            for label in np.unique(piece[on_floor]):
                yield np.searchsorted(used, np.unique(on_floor[piece[on_floor[:, 0]] == label]))
