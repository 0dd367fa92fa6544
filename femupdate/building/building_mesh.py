"""A building as a finite-element model, and what the model's nodes mean."""

from collections.abc import Mapping
from dataclasses import dataclass

from femupdate.arrays import Floats, Integers
from femupdate.building.parameters import StiffnessFactor
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
