"""A building as a finite-element model, and what the model's nodes mean."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from femupdate.arrays import Floats, Integers
from femupdate.building.connections import connected
from femupdate.building.masses import Massive, place_masses
from femupdate.building.parameters import StiffnessFactor, stiffness_factors, with_factors
from femupdate.building.walls import DeadWall
from femupdate.fe.model import FiniteElementModel


@dataclass(frozen=True, kw_only=True)
class BuildingMesh:
    """A meshed building.

    Attributes:
        model: the finite-element model.
        floors: names of the floors, bottom to top ("2F" ... "RF").
        floor_nodes: node indices of each floor's sensor points.
        floor_level: (floors,) height above the base, m.
        base_nodes: (n,) indices of the nodes at the base.
        direction: 0 where motion is measured along x, 1 along y.
        story_names: names of the stories, bottom to top.
        factors: the model's parameters; group i of its elements has the factor i.
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
    parts: tuple[Integers, ...] | None = None


def finished(
    building: Massive,
    model: FiniteElementModel,
    base: Integers,
    floor_nodes: Mapping[str, Integers],
    *,
    diaphragms: Iterable[Integers] = (),
    dead: Sequence[DeadWall] = (),
    parts: tuple[Integers, ...] | None = None,
) -> BuildingMesh:
    """Return the mesh of a building with its masses, supports, links and stiffness factors.

    Args:
        model: elements only, whose groups are stories.
        base, floor_nodes, parts: as of a `BuildingMesh`.
        diaphragms: node indices of each slab that is rigid in plan.
        dead: walls without stiffness, on the model's nodes.

    Raises:
        Complaint: a floor lighter than its self weight, or one without a slab.
    """
    masses, factors = place_masses(building, model, dead), stiffness_factors(building)
    held = connected(model, base, building.supports, diaphragms)
    if building.by_kind:
        held = with_factors(held, factors)
    return BuildingMesh(
        model=replace(held, masses=masses),
        floors=building.floors,
        floor_nodes=floor_nodes,
        floor_level=building.floor_levels,
        base_nodes=base,
        direction="xy".index(building.sensors.direction),
        story_names=building.story_names,
        factors=factors,
        parts=parts,
    )
