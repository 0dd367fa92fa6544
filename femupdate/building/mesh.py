"""Meshes a frame building: nodes, shells, bars, masses, supports, and where the floors are."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from femupdate.arrays import Floats, Integers
from femupdate.building.bars import Bar, beam_bars, column_bars, column_lines
from femupdate.building.connections import connected, face_lines
from femupdate.building.entry import Complaint
from femupdate.building.frame import CLOSEST_LINES, FrameBuilding
from femupdate.building.lattice import Lattice, lattice_of
from femupdate.building.masses import ground_mass, place_masses
from femupdate.building.own_mesh import MeshBuilding
from femupdate.building.panels import DeadWall, Panel, slab_panels
from femupdate.building.parameters import (
    StiffnessFactor,
    stiffness_factors,
    with_factors,
)
from femupdate.building.references import intersections
from femupdate.building.schema import Building
from femupdate.building.walls import dead_walls, opening_lines, wall_panels
from femupdate.errors import BuildingError
from femupdate.fe.elements.beam import Beams
from femupdate.fe.elements.shell import Shells
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel


@dataclass(frozen=True)
class BuildingMesh:
    """A building as a finite-element model, and what the model's nodes mean.

    Attributes:
        model: the finite-element model.
        floors: names of the floors, bottom to top ("2F" ... "RF").
        floor_nodes: node indices of each floor's sensor points.
        floor_level: (floors,) height above the base, m.
        base_nodes: (n,) indices of the nodes at the base.
        direction: 0 where motion is measured along x, 1 along y.
        story_names: names of the stories, bottom to top.
        factors: the model's parameters; group i of its elements has the factor i.
        ground_mass: the half of first-story walls without stiffness that rests on the ground and
            is not in the model, kg.
        parts: of a mesh that was read: which of the file's `parts` each element belongs to, one
            array a block of the model's elements.
    """

    model: FiniteElementModel
    floors: tuple[str, ...]
    floor_nodes: Mapping[str, Integers]
    floor_level: Floats
    base_nodes: Integers
    direction: int
    story_names: tuple[str, ...]
    factors: tuple[StiffnessFactor, ...]
    ground_mass: float
    parts: tuple[Integers, ...] | None = None


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
        from femupdate.building.mesh_import import import_mesh

        if mesh_size is not None:
            raise BuildingError(
                f"{building.name}: mesh.size: the mesh comes from {building.mesh.file}; refine it "
                "in the program that made it"
            )
        return import_mesh(building)
    if not isinstance(building, FrameBuilding):
        raise BuildingError(
            f'{building.name}: kind: a building of kind "shear" has no mesh; use shear_operators'
        )
    size = building.mesh.size if mesh_size is None else mesh_size
    if not size > 0.0:
        raise BuildingError(f"mesh.size: {size!r} m must be greater than 0; write a length")
    return _mesh(building, size)


def check_mesh(building: FrameBuilding | MeshBuilding) -> None:
    """Raise BuildingError where `mesh_building` would, at the cost of a very coarse mesh."""
    if isinstance(building, MeshBuilding):
        mesh_building(building)
        return
    lattice_of(building.grid, building.stories, building.mesh.size)
    # Two parts an interval: what nothing carries between two grid lines shows as well.
    _mesh(building, math.inf, least=2)


def _mesh(building: FrameBuilding, size: float, least: int = 1) -> BuildingMesh:
    try:
        extra = column_lines(building) + opening_lines(building)
        if _may_have_joints(building):
            coarse = lattice_of(building.grid, building.stories, math.inf, 2, extra)
            parts = _parts_on(building, coarse)
            extra += face_lines(parts.model)
        lattice = lattice_of(building.grid, building.stories, size, least, extra)
        return _mesh_on(building, lattice)
    except Complaint as complaint:
        raise BuildingError(f"{complaint.key}: {complaint}") from None


def _may_have_joints(building: FrameBuilding) -> bool:
    return bool(building.walls or building.slabs) and bool(building.beams or building.columns)


@dataclass(frozen=True)
class _Parts:
    """The elements of a building on the crossings of a lattice.

    Attributes:
        model: elements only, no supports.
        used: (N,) crossing of each node.
        panels: the model's shells, block by block.
    """

    model: FiniteElementModel
    used: Integers
    panels: tuple[Panel, ...]


def _parts_on(building: FrameBuilding, lattice: Lattice) -> _Parts:
    panels = [*slab_panels(building, lattice), *wall_panels(building, lattice)]
    bars = [*column_bars(building, lattice), *beam_bars(building, lattice)]
    _refuse_doubles(panels, lattice)
    _refuse_doubles(bars, lattice)
    used = np.unique(np.concatenate([n.ravel() for n in _node_lists(panels, bars)]))
    model = FiniteElementModel(
        nodes=lattice.coordinates(used),
        fixed=np.zeros((len(used), DOF_PER_NODE), dtype=np.bool_),
        groups=len(building.stories),
        elements=(_shells(panels, used), _beams(bars, used)),
    )
    return _Parts(model, used, tuple(panels))


def _mesh_on(building: FrameBuilding, lattice: Lattice) -> BuildingMesh:
    parts = _parts_on(building, lattice)
    used, dead = parts.used, list(dead_walls(building, lattice))
    base = np.flatnonzero(lattice.level(used) == 0)
    _refuse_floating(parts.model, base)
    _refuse_loose_columns(building, parts)
    masses = place_masses(building, parts.model, list(_on_nodes(dead, used, lattice)))
    stiff = {n for n, slab in enumerate(building.slabs) if slab.diaphragm == "rigid"}
    diaphragms = [
        np.searchsorted(used, np.unique(panel.nodes))
        for panel in parts.panels
        if panel.key in {f"slabs[{n}]" for n in stiff}
    ]
    model = connected(parts.model, base, building.supports, diaphragms)
    factors = stiffness_factors(building)
    if building.by_kind:
        model = with_factors(model, factors)
    return BuildingMesh(
        model=replace(model, masses=masses),
        floors=building.floors,
        floor_nodes=_floor_nodes(building, lattice, used),
        floor_level=building.floor_levels,
        base_nodes=base,
        direction="xy".index(building.sensors.direction),
        story_names=building.story_names,
        factors=factors,
        ground_mass=ground_mass(dead),
    )


def _node_lists(panels: Sequence[Panel], bars: Sequence[Bar]) -> list[Integers]:
    return [panel.nodes for panel in panels] + [bar.nodes for bar in bars]


def _refuse_doubles(blocks: Sequence[Panel] | Sequence[Bar], lattice: Lattice) -> None:
    """Raise Complaint where two blocks have an element between the same nodes."""
    if not blocks:
        return
    nodes = np.sort(np.concatenate([block.nodes for block in blocks]), axis=1)
    owner = np.repeat(np.arange(len(blocks)), [len(block.nodes) for block in blocks])
    _, first, inverse = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
    double = np.flatnonzero(first[inverse.ravel()] != np.arange(len(nodes)))
    if len(double):
        later, earlier = owner[double[0]], owner[first[inverse.ravel()[double[0]]]]
        x, y, z = lattice.coordinates(nodes[double[0]]).mean(axis=0)
        text = f"it lies on {blocks[earlier].key} at ({x:.3g}, {y:.3g}, {z:.3g}) m; remove one"
        raise Complaint(blocks[later].key, text)


def _spread(values: Sequence[float], counts: Sequence[int]) -> Floats:
    return np.repeat(np.array(values, dtype=np.float64), counts)


def _shells(panels: Sequence[Panel], used: Integers) -> Shells:
    if not panels:
        return Shells()
    counts = [len(panel.nodes) for panel in panels]
    return Shells(
        nodes=np.searchsorted(used, np.concatenate([panel.nodes for panel in panels])),
        thickness=_spread([panel.thickness for panel in panels], counts),
        youngs_modulus=_spread([panel.material.youngs_modulus for panel in panels], counts),
        poisson_ratio=_spread([panel.material.poisson_ratio for panel in panels], counts),
        density=_spread([panel.material.density for panel in panels], counts),
        group=np.repeat(np.array([panel.group for panel in panels], dtype=np.int64), counts),
        kind=np.repeat(np.array([panel.kind for panel in panels], dtype="<U24"), counts),
    )


def _beams(bars: Sequence[Bar], used: Integers) -> Beams:
    if not bars:
        return Beams()
    counts = [len(bar.nodes) for bar in bars]
    sections = [bar.section for bar in bars]
    return Beams(
        nodes=np.searchsorted(used, np.concatenate([bar.nodes for bar in bars])),
        area=_spread([section.area for section in sections], counts),
        shear_area_y=_spread([section.shear_area_y for section in sections], counts),
        shear_area_z=_spread([section.shear_area_z for section in sections], counts),
        inertia_y=_spread([section.inertia_y for section in sections], counts),
        inertia_z=_spread([section.inertia_z for section in sections], counts),
        torsion_constant=_spread([section.torsion_constant for section in sections], counts),
        youngs_modulus=_spread([bar.material.youngs_modulus for bar in bars], counts),
        poisson_ratio=_spread([bar.material.poisson_ratio for bar in bars], counts),
        density=_spread([bar.material.density for bar in bars], counts),
        up=np.repeat(np.array([bar.up for bar in bars]), counts, axis=0),
        size=np.repeat(np.array([section.size for section in sections]), counts, axis=0),
        group=np.repeat(np.array([bar.group for bar in bars], dtype=np.int64), counts),
        kind=np.repeat(np.array([bar.kind for bar in bars], dtype="<U24"), counts),
        offset=_stacked([bar.offset for bar in bars], counts, (2, 3), np.float64),
        released=_stacked([bar.released for bar in bars], counts, (12,), np.bool_),
    )


def _stacked(
    parts: Sequence[NDArray[Any] | None], counts: Sequence[int], shape: tuple[int, ...], dtype: type
) -> NDArray[Any] | None:
    """Join what some bars have, with zeros for the others; None where no bar has it."""
    if all(part is None for part in parts):
        return None
    return np.concatenate(
        [
            np.zeros((count, *shape), dtype=dtype) if part is None else part
            for part, count in zip(parts, counts, strict=True)
        ]
    )


def _refuse_floating(model: FiniteElementModel, base: Integers) -> None:
    """Raise Complaint where a node has no path of elements down to the base."""
    edges = np.concatenate(
        [part.nodes[:, [0, k]] for part in model.elements for k in range(1, part.node_count())]
    )
    count = len(model.nodes)
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, part = connected_components(graph, directed=False)
    floating = np.flatnonzero(~np.isin(part, part[base]))
    if len(floating):
        x, y, z = model.nodes[floating[0]]
        raise Complaint(
            "columns",
            f"nothing connects what is at ({x:.3g}, {y:.3g}, {z:.3g}) m to the base; add a "
            "column, wall, beam or slab that does",
        )


def _refuse_loose_columns(building: FrameBuilding, parts: _Parts) -> None:
    """Raise Complaint for a column off the grid whose top nothing meets."""
    met = np.concatenate(
        [part.nodes[part.kind != "column"].ravel() for part in parts.model.elements]
    )
    for n, columns in enumerate(building.columns):
        for m, point in enumerate(columns.points):
            away = np.linalg.norm(parts.model.nodes[:, :2] - point, axis=1)
            if not np.isin(np.flatnonzero(away < CLOSEST_LINES), met).any():
                text = "no slab, beam or wall meets the column there; move it or add one"
                raise Complaint(f"columns[{n}].points[{m}]", text)


def _on_nodes(dead: Sequence[DeadWall], used: Integers, lattice: Lattice) -> Iterator[DeadWall]:
    """Yield the walls without stiffness with node indices in place of crossings."""
    for wall in dead:
        _refuse_uncarried(wall, used, lattice)
        above, below = np.searchsorted(used, wall.above), np.searchsorted(used, wall.below)
        yield replace(wall, above=above, below=below)


def _refuse_uncarried(wall: DeadWall, used: Integers, lattice: Lattice) -> None:
    for place, crossings in (("above", wall.above), ("below", wall.below)):
        missing = crossings[~np.isin(crossings, used)]
        if len(missing):
            x, y, z = lattice.coordinates(missing[:1])[0]
            text = f"nothing at ({x:.3g}, {y:.3g}, {z:.3g}) m, {place} the wall, carries its weight"
            raise Complaint(wall.key, f"{text}; put a beam or a slab along it")


def _floor_nodes(
    building: FrameBuilding, lattice: Lattice, used: Integers
) -> Mapping[str, Integers]:
    nodes = {}
    for floor in building.floors:
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
