"""The mesh of a building of any kind, and that of a frame from its grid lines."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from femupdate.arrays import Integers
from femupdate.building.blocks import (
    ElementBlock,
    beam_blocks,
    brace_blocks,
    by_element,
    column_blocks,
    column_lines,
    dead_walls,
    infill_blocks,
    infill_notes,
    joined,
    opening_lines,
    slab_blocks,
    wall_blocks,
)
from femupdate.building.building_mesh import BuildingMesh, face_lines, finished
from femupdate.building.document import Building
from femupdate.building.entry import Complaint, complaining
from femupdate.building.kinds import CLOSEST_LINES, FrameBuilding, MeshBuilding
from femupdate.building.lattice import Lattice, lattice_of
from femupdate.building.mesh_check import first_double, loose_pieces, nodes_at, place
from femupdate.building.mesh_import import import_mesh
from femupdate.building.references import intersections
from femupdate.building.split_mesh import split_mesh
from femupdate.errors import BuildingError
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel


@complaining()
def mesh_frame(building: FrameBuilding, size: float, least: int = 1) -> BuildingMesh:
    """Return the mesh of a frame; size and least as for `lattice_of`."""
    extra = column_lines(building) + opening_lines(building)
    if (building.walls or building.slabs) and (building.beams or building.columns):
        coarse = lattice_of(building, math.inf, 2, extra)
        extra += face_lines(_parts_on(building, coarse)[0])
    return _mesh_on(building, lattice_of(building, size, least, extra))


def _parts_on(
    building: FrameBuilding, lattice: Lattice
) -> tuple[FiniteElementModel, Integers, list[ElementBlock]]:
    """Elements on the crossings of a lattice, the crossing of each node, and them by members."""
    blocks = [
        *slab_blocks(building, lattice),
        *wall_blocks(building, lattice),
        *column_blocks(building, lattice),
        *beam_blocks(building, lattice),
        *brace_blocks(building, lattice),
        *infill_blocks(building, lattice),
    ]
    for alike in by_element(blocks).values():
        nodes = np.concatenate([block.nodes for block in alike])
        double = first_double(nodes)
        if double is not None:
            owner = np.repeat(np.arange(len(alike)), [len(block.nodes) for block in alike])
            later, earlier = (alike[owner[index]] for index in double)
            where = place(lattice.coordinates(nodes[double[0]]).mean(axis=0))
            raise Complaint(later.key, f"it lies on {earlier.key} at {where}; remove one")
    used = np.unique(np.concatenate([block.nodes.ravel() for block in blocks]))
    model = FiniteElementModel(
        nodes=lattice.coordinates(used),
        fixed=np.zeros((len(used), DOF_PER_NODE), dtype=np.bool_),
        groups=len(building.stories),
        elements=joined(blocks, used),
    )
    return model, used, blocks


def _mesh_on(building: FrameBuilding, lattice: Lattice) -> BuildingMesh:
    model, used, blocks = _parts_on(building, lattice)
    base = np.flatnonzero(lattice.level(used) == 0)
    pieces = loose_pieces(len(used), [part.nodes for part in model.elements], base)
    if pieces:
        where = place(model.nodes[np.concatenate(pieces).min()])
        raise Complaint(
            "columns",
            f"nothing connects what is at {where} to the base; add a column, wall, beam or slab "
            "that does",
        )
    met = np.concatenate([part.nodes[part.kind != "column"].ravel() for part in model.elements])
    for n, columns in enumerate(building.columns):
        for m, point in enumerate(columns.points):
            away = np.linalg.norm(model.nodes[:, :2] - point, axis=1)
            if not np.isin(np.flatnonzero(away < CLOSEST_LINES), met).any():
                text = "no slab, beam or wall meets the column there; move it or add one"
                raise Complaint(f"columns[{n}].points[{m}]", text)
    for block in (block for block in blocks if block.kind == "brace"):
        others = np.concatenate([other.nodes.ravel() for other in blocks if other.kind != "brace"])
        loose = block.nodes[~np.isin(block.nodes, others)]
        loose = loose[lattice.level(loose) > 0]  # the ground holds what stands on it
        if len(loose):
            where = place(lattice.coordinates(loose[:1])[0])
            text = f"nothing but the brace is at {where}; end it at a column, beam or wall"
            raise Complaint(block.key, text)
    floor_nodes = _floor_nodes(building, lattice, used, model)
    dead = []
    for wall in dead_walls(building, lattice):
        for side, crossings in (("above", wall.above), ("below", wall.below)):
            missing = crossings[~np.isin(crossings, used)]
            if len(missing):
                where = place(lattice.coordinates(missing[:1])[0])
                text = f"nothing at {where}, {side} the wall, carries its weight"
                raise Complaint(wall.key, f"{text}; put a beam or a slab along it")
        above, below = np.searchsorted(used, wall.above), np.searchsorted(used, wall.below)
        dead.append(replace(wall, above=above, below=below))
    rigid = {f"slabs[{n}]" for n, slab in enumerate(building.slabs) if slab.diaphragm == "rigid"}
    return finished(
        building,
        model,
        base,
        floor_nodes,
        diaphragms=[
            np.searchsorted(used, np.unique(block.nodes)) for block in blocks if block.key in rigid
        ],
        dead=dead,
        notes=infill_notes(building),
    )


def _floor_nodes(
    building: FrameBuilding, lattice: Lattice, used: Integers, model: FiniteElementModel
) -> Mapping[str, Integers]:
    nodes = {}
    for floor in building.floors:
        if floor in building.sensors.at:
            nodes[floor] = nodes_at(model, building.sensors.at[floor], f"sensors.at.{floor}")
            continue
        key, names = building.sensors.of(floor)
        points = intersections(building.grid, names, key)
        level = np.array([lattice.z.at[floor]])
        crossings = np.concatenate([lattice.upright(point, level) for point in points])
        for point, crossing in zip(points, crossings, strict=True):
            if crossing not in used:
                text = f"nothing is built at {point.y}-{point.x} on {floor}; name another point"
                raise Complaint(key, text)
        nodes[floor] = np.searchsorted(used, crossings)
    return nodes


def mesh_building(building: Building, mesh_size: float | None = None) -> BuildingMesh:
    """Return the mesh of a building.

    Every interval between grid lines, and every story, is divided into equal parts no longer than
    the mesh size; walls, columns, beams and slabs meet in common nodes on those lines.

    Args:
        building: of kind "frame", or "mesh", whose mesh is read from its file.
        mesh_size: m; the building's own where None.

    Raises:
        BuildingError: a shear building, a size for a mesh that is read, two members in one place,
            a part that is connected to nothing below, a floor lighter than its self weight, a
            sensor where nothing is built.
    """
    if isinstance(building, MeshBuilding):
        if mesh_size is not None:
            raise BuildingError(
                f"{building.name}: mesh.size: the mesh comes from {building.mesh.file}; refine it "
                "by mesh.split, or in the program that made it"
            )
        mesh = import_mesh(building)
        for _ in range(building.mesh.split):
            mesh = replace(split_mesh(mesh), of_coarser=None)
        return mesh
    if not isinstance(building, FrameBuilding):
        raise BuildingError(
            f'{building.name}: kind: a building of kind "shear" has no mesh; use shear_operators'
        )
    size = building.mesh.size if mesh_size is None else mesh_size
    if not size > 0.0:
        raise BuildingError(f"mesh.size: {size!r} m must be greater than 0; write a length")
    return mesh_frame(building, size)


def check_mesh(building: FrameBuilding | MeshBuilding) -> None:
    """Raise BuildingError where `mesh_building` would, at the cost of a very coarse mesh."""
    if isinstance(building, MeshBuilding):
        mesh_building(building)
        return
    lattice_of(building, building.mesh.size)
    # Two parts an interval: what nothing carries between two grid lines shows as well.
    mesh_frame(building, math.inf, least=2)
