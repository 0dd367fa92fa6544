"""Blocks of elements that share a member's properties, and their union as a model's elements."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from femupdate.arrays import Flags, Floats, Integers, Strings
from femupdate.building.members import Material
from femupdate.building.sections import SectionFigures
from femupdate.fe.element import Elements

# Shape of what an element has more than one figure of.
_SHAPES = {"up": (3,), "size": (2,), "offset": (2, 3), "released": (12,)}


@dataclass(frozen=True, kw_only=True)
class ElementBlock:
    """The n elements of one member in one story or on one floor, or of one part of a read mesh.

    Attributes:
        key: the entry of the file that it comes from, such as "walls[2]".
        element: the kind of element.
        nodes: (n, k) points of a lattice, or nodes of a read mesh.
        group: index of the story that owns it, or (n,) of each element.
        kind: "wall", "non_structural_wall", "slab", "column", "beam" or "brace", or (n,) of each
            element.
        material: of all.
        thickness: of surfaces, m.
        section: of lines.
        up, offset, released: as for `femupdate.fe.elements.beam.Beams`; None where there are none.
        part: number of the part of a read mesh.
    """

    key: str
    element: type[Elements]
    nodes: Integers
    group: int | Integers
    kind: str | Strings
    material: Material
    thickness: float | None = None
    section: SectionFigures | None = None
    up: tuple[float, float, float] | Floats | None = None
    offset: Floats | None = None
    released: Flags | None = None
    part: int = -1

    def values(self) -> dict[str, Any]:
        """What the element's fields are filled with, by their names."""
        filled = {item.name: getattr(self, item.name) for item in fields(self)}
        filled |= dict(self.material)
        if self.section is not None:
            filled |= {item.name: getattr(self.section, item.name) for item in fields(self.section)}
            filled["size"] = self.section.size
        return filled


def by_element(blocks: Sequence[ElementBlock]) -> dict[type[Elements], list[ElementBlock]]:
    """Return the blocks of each kind of element, in the order of a model's elements."""
    kinds = dict.fromkeys(block.element for block in blocks)
    return {kind: [block for block in blocks if block.element is kind] for kind in kinds}


def joined(blocks: Sequence[ElementBlock], used: Integers) -> tuple[Elements, ...]:
    """Return the elements of blocks, one block a kind.

    Args:
        blocks: whose elements have fields for what the blocks hold, or do without it.
        used: points of the lattice, or nodes of the read mesh, that are the model's nodes.
    """
    return tuple(_joined(kind, alike, used) for kind, alike in by_element(blocks).items())


def _joined(kind: type[Elements], blocks: Sequence[ElementBlock], used: Integers) -> Elements:
    nodes = np.searchsorted(used, np.concatenate([block.nodes for block in blocks]))
    known = [block.values() for block in blocks]
    filled: dict[str, Any] = {"nodes": nodes}
    for name in {item.name for item in fields(kind)} - {"nodes"}:
        columns = [values.get(name) for values in known]
        given = [np.asarray(value) for value in columns if value is not None]
        if given:
            shape = _SHAPES.get(name, ())
            nothing = np.zeros(shape, dtype=given[0].dtype)
            filled[name] = np.concatenate(
                [
                    np.broadcast_to(nothing if value is None else value, (len(block.nodes), *shape))
                    for value, block in zip(columns, blocks, strict=True)
                ]
            )
    return kind(**filled)
