"""Masses of a frame building beside those of its elements: floor masses and dead walls."""

from collections.abc import Iterable, Sequence

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.entry import Complaint
from femupdate.building.frame import FrameBuilding
from femupdate.building.own_mesh import MeshBuilding
from femupdate.building.panels import DeadWall
from femupdate.building.references import resolve
from femupdate.fe.model import FiniteElementModel, PointMasses
from femupdate.fe.triangle import triangle_areas

Massive = FrameBuilding | MeshBuilding
_ROUNDING = 1e-9  # of a floor's mass


def shell_areas(model: FiniteElementModel) -> Floats:
    """Return the area of each (flat) shell, (n,) m2: half the cross product of its diagonals."""
    corners = model.nodes[model.shells.nodes]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return np.linalg.norm(across, axis=1) / 2.0


def bar_lengths(model: FiniteElementModel) -> Floats:
    """Return the length of each beam element between its rigid arms, (n,) m."""
    ends = model.nodes[model.beams.nodes]
    if model.beams.offset is not None:
        ends = ends + model.beams.offset
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def self_mass(model: FiniteElementModel, dead: Iterable[DeadWall]) -> Floats:
    """Return the mass of what each story owns, (groups,) kg.

    Story i owns the columns and walls below floor i+1, those without stiffness included, and that
    floor's slab and beams; all are taken between centre lines, without deducting their overlaps.
    """
    shells, beams, three = model.shells, model.beams, model.triangles
    sheets = shell_areas(model) * shells.thickness * shells.density
    small = triangle_areas(model.nodes[three.nodes]) * three.thickness * three.density
    bars = bar_lengths(model) * beams.area * beams.density
    total = np.zeros(model.groups)
    np.add.at(total, shells.group, sheets)
    np.add.at(total, three.group, small)
    np.add.at(total, beams.group, bars)
    for wall in dead:
        total[wall.group] += wall.mass
    return total


def ground_mass(dead: Iterable[DeadWall]) -> float:
    """Return what walls without stiffness leave on the ground, kg."""
    return sum((wall.mass / 2.0 for wall in dead if not len(wall.below)), start=0.0)


def _tributary(model: FiniteElementModel, group: int) -> Floats:
    """Return the slab area that each node of a floor carries, (N,) m2."""
    on_floor = (model.shells.kind == "slab") & (model.shells.group == group)
    area = np.zeros(len(model.nodes))
    np.add.at(area, model.shells.nodes[on_floor], shell_areas(model)[on_floor, None] / 4.0)
    three = model.triangles
    on_floor = (three.kind == "slab") & (three.group == group)
    corners = three.nodes[on_floor]
    np.add.at(area, corners, triangle_areas(model.nodes[corners])[:, None] / 3.0)
    return area


def _rest(building: Massive, own: Floats, key: str, total: float, floor: str) -> float:
    weight = own[building.floors.index(floor)]
    rest = total - weight
    if rest < -_ROUNDING * total:
        text = (
            f"{floor} weighs {weight / 1e3:.4g} t by itself (its slab and beams, and the columns "
            f"and walls below it), more than the {total / 1e3:.4g} t in all; raise the total"
        )
        raise Complaint(f"{key}.total", text)
    return max(rest, 0.0)


def _floor_rest(building: Massive, model: FiniteElementModel, own: Floats) -> Floats:
    """Return what the floor masses leave after the self weight, spread over the slabs, (N,) kg."""
    spread = np.zeros(len(model.nodes))
    for number, mass in enumerate(building.floor_mass):
        key = f"floor_mass[{number}]"
        for floor in resolve(mass.floors, building.floors, "floor", f"{key}.floors"):
            rest = _rest(building, own, key, mass.total, floor)
            area = _tributary(model, building.floors.index(floor))
            if rest > _ROUNDING * mass.total and not area.any():
                text = f"{floor} has no slab to carry its mass; add one, or remove the floor mass"
                raise Complaint(f"{key}.floors", text)
            spread += rest * area / (area.sum() or 1.0)
    return spread


def place_masses(
    building: Massive, model: FiniteElementModel, dead: Sequence[DeadWall]
) -> PointMasses:
    """Return the masses at nodes: the rest of the floor masses, and the walls without stiffness.

    Half of such a wall goes to the nodes along it on the floor above and half to those on the
    floor below; on the ground the lower half is left out. Before that its whole mass counts as
    self weight of the floor above, like that of the walls with stiffness.

    Raises:
        Complaint: a floor lighter than its self weight, or one without a slab.
    """
    at_node = _floor_rest(building, model, self_mass(model, dead))
    for wall in dead:
        np.add.at(at_node, wall.above, wall.share)
        if len(wall.below):
            np.add.at(at_node, wall.below, wall.share)
    node = np.flatnonzero(at_node)
    return PointMasses(node=node, mass=at_node[node], inertia=np.zeros((len(node), 3)))
